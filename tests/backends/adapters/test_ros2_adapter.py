"""emit-c --with ros2: the controllers, compiled with the headers in the folder `ros` that stand in for ROS 2's, against
Pinocchio; and the ament package, where ament is installed."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot, under_gravity, weighed_model
from installed import is_installed
from random_trees import RandomTree

from psdmc.compiler import compare_emitted, emit_c
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot.reference import reference

needs_gpp = pytest.mark.skipif(not is_installed("g++"), reason="g++ is not installed")
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wno-sign-conversion", "-Wshadow", "-Werror"]
AMENT = Path("/usr/share/ament_cmake/cmake")
ROS = (
    "controller_interface",
    "hardware_interface",
    "pluginlib",
    "rclcpp",
    "rclcpp_lifecycle",
    "trajectory_msgs",
)


def compiled(robot: str, folder: Path, gravity_input: bool = False) -> Path:
    """The program that runs the controllers of a robot."""
    model = (weighed_model if gravity_input else bundled_model)(robot)
    own = {"functions": "gravity", "adapters": "ros2", "gravity_input": gravity_input}
    emit_c(model, folder / "arm", name="arm", **own)  # type: ignore[arg-type]
    include, headers = folder / "arm" / "include", Path(__file__).parent / "ros"
    sources = sorted((folder / "arm" / "src").glob("*.c"))
    subprocess.run(["cc", "-std=c99", "-O0", "-c", f"-I{include}", *sources], cwd=folder, check=True)
    objects = [f"{path.stem}.o" for path in sources]
    places = [f"-I{path}" for path in (include, headers, folder / "arm" / "ros2")]
    command = ["g++", "-std=c++17", "-O0", *WARNINGS, *places, headers / "drive.cpp", *objects, "-o", "drive"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "drive"


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled("kr6", tmp_path_factory.mktemp("ros2"))


def driven(
    drive: Path, law: str, *rows: np.ndarray, gravity: Sequence[float] = ()
) -> subprocess.CompletedProcess[str]:
    given = " ".join(repr(float(value)) for row in rows for value in row)
    return subprocess.run(
        [drive, law, *map(repr, gravity)], input=given, capture_output=True, text=True, check=False
    )


def torques(done: subprocess.CompletedProcess[str], robot: str) -> np.ndarray:
    """The commands, after the number of allocations, which is zero."""
    assert done.returncode == 0, done.stdout
    allocations, *lines = [line for line in done.stdout.splitlines() if "left out" not in line]
    assert allocations == "0"
    names = [f"{name}/effort" for name in bundled_model(robot).joint_names]
    assert [line.split()[0] for line in lines] == names
    return np.array([float(line.split()[1]) for line in lines])


@needs_gpp
def test_torques_are_pinocchio_s_and_nothing_is_allocated(drive: Path) -> None:
    rng, oracle = np.random.default_rng(2), reference(bundled_robot("kr6"))
    stiffness, damping = rng.uniform(0.0, 20.0, (2, 6))
    q, qd, q_wanted, qd_wanted, qdd = rng.uniform(-1.0, 1.0, (5, 6))

    held = torques(driven(drive, "gravity", stiffness, damping, q, qd), "kr6")
    done = driven(drive, "computed", stiffness, damping, q, qd, q_wanted, qd_wanted, qdd)

    expected = oracle.gravity(q[None])[0] - damping * qd
    assert np.abs(held - expected).max() < 1e-12 * np.abs(expected).max()
    x = qdd + damping * (qd_wanted - qd) + stiffness * (q_wanted - q)
    expected = oracle.inverse_dynamics(q[None], qd[None], x[None])[0]
    assert np.abs(torques(done, "kr6") - expected).max() < 1e-12 * np.abs(expected).max()
    assert done.stdout.startswith("reference left out: it needs 6 finite numbers per field\n")


@needs_gpp
def test_gravity_is_a_parameter(tmp_path: Path) -> None:
    rng, oracle, pull = np.random.default_rng(2), reference(bundled_robot("scara")), (3.0, -2.0, 6.0)
    drive, zero = compiled("scara", tmp_path, gravity_input=True), np.zeros(4)
    q, qd, qdd = rng.uniform(-1.0, 1.0, (3, 4))
    for given, robot in (((), oracle), (pull, under_gravity(oracle, pull))):
        held = torques(driven(drive, "gravity", zero, zero, q, qd, gravity=given), "scara")
        moved = torques(driven(drive, "computed", zero, zero, q, qd, q, qd, qdd, gravity=given), "scara")
        assert np.abs(held - robot.gravity(q[None])[0]).max() < 1e-12 * np.abs(held).max()
        expected = robot.inverse_dynamics(q[None], qd[None], qdd[None])[0]
        assert np.abs(moved - expected).max() < 1e-12 * np.abs(expected).max()
    for wrong in ((0.0, 0.0), (0.0, 0.0, float("nan"))):
        assert driven(drive, "gravity", zero, zero, q, qd, gravity=wrong).returncode == 1


@needs_gpp
def test_wrong_gains_and_states_are_errors(drive: Path) -> None:
    zero, one = np.zeros(6), np.ones(6)
    assert driven(drive, "gravity", -one, zero, zero, zero).returncode == 1
    assert driven(drive, "gravity", zero, zero * np.nan, zero, zero).returncode == 1
    assert driven(drive, "gravity", zero, zero, zero * np.nan, zero).returncode == 1


@needs_gpp
@pytest.mark.slow
def test_torques_stay_within_the_robot_s_limits(tmp_path: Path) -> None:
    drive = compiled("rounded_arm", tmp_path)
    limits = np.array([joint.limits.effort for joint in bundled_model("rounded_arm").mechanism.joints])
    assert np.isfinite(limits).any()
    zero = np.zeros(6)
    found = torques(driven(drive, "gravity", zero, np.full(6, 1e6), zero, np.full(6, -1.0)), "rounded_arm")
    assert (found[np.isfinite(limits)] == limits[np.isfinite(limits)]).all()


def test_xml_files_name_what_the_code_exports(tmp_path: Path) -> None:
    arm = bundled_model("two_link")
    emit_c(arm, tmp_path / "c", functions="gravity", adapters="ros2", name="Arm")
    folder = tmp_path / "c" / "ros2"
    package = ElementTree.parse(folder / "package.xml").getroot()
    assert package.findtext("name") == "arm_controllers"
    assert [each.text for each in package.findall("depend")] == ["Arm", *ROS]
    plugins = ElementTree.parse(folder / "plugins.xml").getroot()
    exported = [f"PLUGINLIB_EXPORT_CLASS({each.get('type')}," for each in plugins.findall("class")]
    code = (folder / "Arm_plugin.cpp").read_text()
    assert len(exported) == 2
    assert all(each in code for each in exported)
    assert not compare_emitted(arm, tmp_path / "c")


def configured(source: Path, build: Path, *options: str) -> subprocess.CompletedProcess[str]:
    given = ["cmake", "-S", source, "-B", build, "-DPython3_EXECUTABLE=/usr/bin/python3", *options]
    return subprocess.run(given, capture_output=True, text=True, check=False)


@pytest.mark.skipif(not AMENT.exists(), reason="ament_cmake is not installed")
@pytest.mark.slow
def test_ament_builds_the_package_without_the_plugin(tmp_path: Path) -> None:
    """Debian 12 has ament_cmake, and no package of ros2_control."""
    emit_c(bundled_model("two_link"), tmp_path / "arm", functions="gravity", adapters="ros2", name="arm")
    prefix = f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'installed'}"
    found = f"-DCMAKE_PREFIX_PATH={tmp_path / 'installed'}"
    builds = (("arm", "-DBUILD_TESTING=OFF"), ("arm/ros2", "-Darm_controllers_PLUGIN=OFF"))
    for source, option in builds:
        done = configured(tmp_path / source, tmp_path / "build" / source, prefix, found, option)
        assert done.returncode == 0, done.stderr
        install = ["cmake", "--build", tmp_path / "build" / source, "--target", "install"]
        subprocess.run(install, check=True, capture_output=True)
    index = tmp_path / "installed" / "share" / "ament_index" / "resource_index" / "packages"
    assert (index / "arm_controllers").exists()
    assert (tmp_path / "installed" / "include" / "arm_controllers" / "arm_control.hpp").exists()

    whole = configured(tmp_path / "arm" / "ros2", tmp_path / "whole", found)

    if whole.returncode:
        assert 'provided by\n  "controller_interface"' in whole.stderr, whole.stderr
        pytest.skip(f"the plugin was compiled without ROS: not installed are {', '.join(ROS)}")
    subprocess.run(["cmake", "--build", tmp_path / "whole"], check=True)


def test_robots_that_have_no_controller_are_refused(tmp_path: Path) -> None:
    arm = bundled_model("two_link")
    for model, options, expected in (
        (arm, {"real": "float32"}, "a ROS 2 controller computes with double"),
        (replace(arm, theta_b=None), {}, "needs values of the base parameters"),
        (derive_model(RandomTree(5, (-1, 0), "FR").mechanism(), expand=False), {}, "several coordinates"),
    ):
        with pytest.raises(InputError, match=expected):
            emit_c(model, tmp_path / "c", functions="gravity", adapters="ros2", **options)  # type: ignore[arg-type]
    assert not (tmp_path / "c").exists()
