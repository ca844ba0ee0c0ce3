"""examples/consumers: programs of people who never saw psdmc, each built from an emitted package and run."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from bundled import bundled_model
from installed import need, run

from psdmc.compiler import emit_c

CONSUMERS = Path(__file__).parent.parent.parent / "examples" / "consumers"
ROBOTS = ("two_link", "scara")
STRICT = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wold-style-cast", "-Werror"]
STATE = ([0.3, -0.7], [1.1, 0.4], [2.0, -3.0])
"""What the C and the Eigen program ask for."""


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the emitted packages, built by their Makefiles."""
    need("make")
    root = tmp_path_factory.mktemp("packages")
    for robot in ROBOTS:
        emit_c(bundled_model(robot), root / robot)
        run("make", "-C", root / robot, "CFLAGS=-O0", f"PREFIX={root}/prefix", "install")
    return root


@pytest.fixture(scope="module")
def prefix(packages: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same packages, installed by CMake."""
    need("cmake")
    prefix = tmp_path_factory.mktemp("prefix")
    for robot in ROBOTS:
        build = str(packages / robot / "cmake-build")
        run(
            "cmake", "-S", packages / robot, "-B", build, "-DBUILD_TESTING=OFF", "-DCMAKE_C_FLAGS_RELEASE=-O0"
        )
        run("cmake", "--build", build, "--parallel", "2")
        run("cmake", "--install", build, "--prefix", prefix)
    return prefix


def _with_cmake(consumer: str, prefix: Path, build: Path) -> str:
    """The program's output, found through find_package alone."""
    flags = [f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_CXX_FLAGS={' '.join(STRICT)}"]
    run("cmake", "-S", CONSUMERS / consumer, "-B", build, *flags)
    run("cmake", "--build", build)
    return run(build / "consumer")


def _with_pkg_config(compile_words: list[str], packages: Path, program: Path) -> str:
    need("pkg-config", compile_words[0])
    folder = str(packages / "prefix" / "lib" / "pkgconfig")
    found = run("pkg-config", "--cflags", "--libs", "two_link", PKG_CONFIG_PATH=folder).split()
    run(*compile_words, *found, "-o", program)
    return run(program, LD_LIBRARY_PATH=str(packages / "prefix" / "lib"))


def _assert_torques_of_the_state(output: str) -> None:
    q, qd, qdd = map(np.array, STATE)
    model = bundled_model("two_link")
    rows = [line.split() for line in output.splitlines()]
    assert tuple(row[0] for row in rows) == model.joint_names
    found = np.array([row[1:] for row in rows], float)
    np.testing.assert_allclose(found[:, 0], model.inverse_dynamics(q, qd, qdd), rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], qdd, rtol=1e-11)


@pytest.mark.slow
def test_c_through_find_package(prefix: Path, tmp_path: Path) -> None:
    _assert_torques_of_the_state(_with_cmake("c", prefix, tmp_path))


def test_c_through_pkg_config(packages: Path, tmp_path: Path) -> None:
    words = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", str(CONSUMERS / "c" / "main.c")]
    _assert_torques_of_the_state(_with_pkg_config(words, packages, tmp_path / "main"))


def _last_torques(robot: str, steps: int = 20000) -> np.ndarray:
    """What main.cpp's control law ends with, from the model."""
    model = bundled_model(robot)
    q = 1e-4 * (steps - 1) * np.arange(1, model.n + 1)
    return model.inverse_dynamics(q, 0.5 - q, q - 0.2)


@pytest.mark.slow
def test_cpp17_class_of_two_robots_in_two_threads(prefix: Path, tmp_path: Path) -> None:
    """The program itself checks that each thread got what it gets alone."""
    need("g++")
    rows = [line.split() for line in _with_cmake("cpp", prefix, tmp_path).splitlines()]
    assert [row[0] for row in rows] == ["two_link", "scara"]
    for robot, *torques in rows:
        np.testing.assert_allclose(np.array(torques, float), _last_torques(robot), rtol=1e-10)


def test_cpp17_class_with_eigen_maps(packages: Path, tmp_path: Path) -> None:
    eigen = _eigen_headers()
    if eigen is None:
        pytest.skip("Eigen is not installed (Debian: libeigen3-dev; PyPI: cmeel-eigen)")
    source = str(CONSUMERS / "cpp" / "with_eigen.cpp")
    words = ["g++", "-std=c++17", "-O1", *STRICT, "-isystem", str(eigen), source]
    lines = _with_pkg_config(words, packages, tmp_path / "main").splitlines()
    consistency, asymmetry = float(lines[0]), float(lines[1])
    assert consistency < 1e-14
    assert asymmetry == 0.0
    assert lines[2] == "1 1"  # both joints of a planar arm turn its tip about z


def _eigen_headers() -> Path | None:
    places = [Path("/usr/include/eigen3"), Path("/usr/local/include/eigen3")]
    cmeel = importlib.util.find_spec("cmeel")
    if cmeel is not None and cmeel.submodule_search_locations:
        places.append(
            Path(cmeel.submodule_search_locations[0]).parent / "cmeel.prefix" / "include" / "eigen3"
        )
    return next((place for place in places if (place / "Eigen" / "Dense").is_file()), None)


def test_the_header_is_all_there_is_to_the_class(packages: Path, tmp_path: Path) -> None:
    """Calls cost what C calls cost: at -O2 no member function is left, and nothing allocates or throws."""
    need("g++", "nm")
    source = tmp_path / "main.cpp"
    source.write_text(
        '#include "scara/scara.hpp"\n'
        "scara::Robot::Vector f(const scara::Robot::Vector &q) { return scara::Robot::gravity(q); }\n"
        "int g(const scara::RobotWithParameters &robot, const double *q, double *qdd)\n"
        "{ return robot.forward_dynamics(q, q, q, qdd); }\n"
    )
    flags = ["-std=c++17", "-O2", "-fno-exceptions", "-fno-rtti", *STRICT]
    words = ["g++", *flags, f"-I{packages}/scara/include", "-c", str(source)]
    run(*words, "-o", tmp_path / "main.o")
    symbols = [line.split()[-1] for line in run("nm", "-u", tmp_path / "main.o").splitlines()]
    assert sorted(set(symbols) - {"__stack_chk_fail"}) == ["scara_forward_dynamics_theta", "scara_gravity"]


@pytest.mark.parametrize("robot", ROBOTS)
def test_python_through_cffi(robot: str, packages: Path) -> None:
    script = str(CONSUMERS / "python" / "with_cffi.py")
    found = json.loads(run(sys.executable, "-I", script, packages / robot))
    model = bundled_model(robot)
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 1000, model.n))
    assert found["joints"] == ", ".join(model.joint_names)
    assert found["failed"] == 0
    assert found["error"] < 1e-9
    np.testing.assert_allclose(found["tau"], model.inverse_dynamics(q[0], qd[0], qdd[0]), rtol=1e-11)
