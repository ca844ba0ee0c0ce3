"""emit-c --with mex: MEX functions in Octave against Pinocchio. S-functions run without Simulink: the folder `simulink`
declares the part of its interface that they call."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from bundled import ROBOTS, bundled_model, bundled_robot, under_gravity, weighed_model
from installed import is_installed
from scipy.io import loadmat, savemat

import psdmc
from psdmc.compiler import compare_emitted, emit_c
from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference
from psdmc.toolchain.compiler_command import find_compiler

octave = pytest.mark.skipif(
    not (is_installed("octave-cli") and is_installed("mkoctfile")), reason="octave is not installed"
)
FUNCTIONS = [
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "gravity",
    "forward_kinematics",
    "neutral",
]
STRICT = "-O0 -Wall -Wextra -Wconversion -Wno-sign-conversion -Wshadow -Werror"

HOPPER = """<robot name="hopper">
  <link name="trunk">
    <inertial><mass value="8"/><inertia ixx="0.08" iyy="0.1" izz="0.12" ixy="0.01" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="hip" type="continuous"><parent link="trunk"/><child link="leg"/><axis xyz="0 1 0"/></joint>
  <link name="leg">
    <inertial>
      <origin xyz="0 0.1 -0.2"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
</robot>"""


def ran(folder: Path, program: str) -> str:
    """What a program of Octave prints in the folder `mex` of a package."""
    command = ["octave-cli", "--quiet", "--no-init-file", "--no-history", "--eval", program]
    done = subprocess.run(command, cwd=folder / "mex", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stderr
    return done.stdout


def built(model: DynamicsModel, folder: Path, functions: list[str], **options: object) -> Path:
    emit_c(model, folder, functions=functions, adapters="mex", **options)  # type: ignore[arg-type]
    (build,) = (folder / "mex").glob("*_build_mex.m")
    ran(folder, f"{build.stem}('{STRICT}')")
    assert not list((folder / "mex").glob("*.o"))
    return folder


def near(found: np.ndarray, expected: np.ndarray, exact: float = 1e-10) -> None:
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() <= exact * np.abs(expected).max()


@pytest.fixture(scope="module")
def kr6(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(bundled_model("kr6"), tmp_path_factory.mktemp("mex") / "kr6", FUNCTIONS, name="arm")


@octave
def test_octave_s_results_are_pinocchio_s(kr6: Path, tmp_path: Path) -> None:
    rng, oracle = np.random.default_rng(3), reference(bundled_robot("kr6"))
    q, qd, x = rng.uniform(-2.0, 2.0, (3, 20, 6))
    theta = np.asarray(bundled_model("kr6").theta_b)
    savemat(tmp_path / "in.mat", {"q": q.T, "qd": qd.T, "x": x.T, "theta": 2.0 * theta[:, None]})
    ran(
        kr6,
        f"""load('{tmp_path}/in.mat');
        tau = arm_inverse_dynamics(q, qd, x);
        qdd = arm_forward_dynamics(q, qd, x);
        one = arm_inverse_dynamics(q(:, 3), qd(:, 3)', x(:, 3));
        first = arm_inverse_dynamics(q, qd(:, 1), x(:, 1));
        M = arm_mass_matrix(q);
        twice = arm_gravity(q, theta);
        [position, rotation] = arm_forward_kinematics(q);
        R = arm_forward_kinematics(q);
        none = size(arm_mass_matrix(zeros(6, 0)));
        rest = arm_neutral();
        info = arm_info();
        assert(isequal(info.theta_b * 2, theta) && numel(info.joint_names) == 6 && isequal(R, position));
        save('-v7', '{tmp_path}/out.mat');""",
    )
    found = loadmat(tmp_path / "out.mat")
    near(found["tau"].T, oracle.inverse_dynamics(q, qd, x))
    near(found["qdd"].T, oracle.forward_dynamics(q, qd, x))
    near(found["M"].transpose(2, 0, 1), oracle.mass_matrix(q))
    near(found["twice"].T, 2.0 * oracle.gravity(q))
    poses = oracle.poses(q, [oracle.tip_name])
    near(found["position"].transpose(2, 0, 1), poses[:, :1, :3, 3])
    near(found["rotation"].transpose(3, 0, 1, 2), poses[:, :1, :3, :3])
    near(
        found["first"].T, oracle.inverse_dynamics(q, *np.broadcast_to(np.stack([qd[:1], x[:1]]), (2, 20, 6)))
    )
    assert np.array_equal(found["one"][:, 0], found["tau"][:, 2])
    assert found["none"].tolist() == [[6, 6, 0]]
    assert not found["rest"].any()


@octave
def test_gravity_is_an_argument_before_theta_b(tmp_path: Path) -> None:
    package = built(weighed_model("scara"), tmp_path / "c", ["gravity"], gravity_input=True, name="arm")
    rng = np.random.default_rng(3)
    q, pull = rng.uniform(-1.0, 1.0, (7, 4)), rng.uniform(-9.0, 9.0, (7, 3))
    savemat(tmp_path / "in.mat", {"q": q.T, "pull": pull.T})
    program = "g = arm_gravity(q, pull); twice = arm_gravity(q, pull, 2 * arm_info().theta_b);"
    ran(package, f"load('{tmp_path}/in.mat'); {program} save('-v7', '{tmp_path}/out.mat');")
    found, oracle = loadmat(tmp_path / "out.mat"), reference(bundled_robot("scara"))
    expected = np.vstack([under_gravity(oracle, g).gravity(x[None]) for x, g in zip(q, pull, strict=True)])
    near(found["g"].T, expected)
    near(found["twice"].T, 2.0 * expected)


WRONG = {
    "arm_gravity()": "0 arguments, expected q, [theta_b]",
    "arm_gravity(z, z, z)": "3 arguments, expected q, [theta_b]",
    "arm_neutral(z)": "1 arguments, expected none",
    "[a, b] = arm_gravity(z)": "2 results, expected 1",
    "arm_gravity(z(1:5))": "q is 5 x 1, expected 6 x N",
    "arm_gravity(zeros(6, 2, 2))": "q is 6 x 2 x 2, expected 6 x N",
    "arm_gravity(zeros(5, 6))": "q is 5 x 6, expected 6 x N",
    "arm_gravity([])": "q is 0 x 0, expected 6 x N",
    "arm_gravity(z, z)": "theta_b is 6 x 1, expected 36 x 1",
    "arm_gravity(z, zeros(36, 2))": "theta_b is 36 x 2, expected 36 x 1",
    "arm_inverse_dynamics(zeros(6, 3), zeros(6, 2), z)": "qd has 2 states, expected 3 or 1",
    "arm_gravity(single(z))": "q is single, expected double",
    "arm_gravity(int32(z))": "q is int32, expected double",
    "arm_gravity(complex(z))": "q is complex double, expected double",
    "arm_gravity(sparse(z))": "q is sparse double, expected double",
    "arm_gravity('abcdef')": "q is char, expected double",
    "arm_gravity({1})": "q is cell, expected double",
    "arm_gravity([z [0 0 NaN 0 0 0]'])": "q(9) is NaN, expected finite numbers",
    "arm_gravity(z, Inf(36, 1))": "theta_b(1) is infinite, expected finite numbers",
}


@octave
def test_wrong_arguments_are_errors_of_one_line(kr6: Path) -> None:
    program = "z = zeros(6, 1);"
    for call in WRONG:
        program += (
            f"try; {call}; disp('no error'); catch e; printf('%s|%s\\n', e.identifier, e.message); end;"
        )

    said = ran(kr6, program).splitlines()

    for call, line in zip(WRONG, said, strict=True):
        name = call.split("(")[0].split()[-1]
        identifier, message = line.split("|")
        assert identifier.startswith("arm:")
        assert message == f"{name}: {WRONG[call]}"  # Octave writes the name; MATLAB shows it, too


@octave
def test_help_and_functions_that_are_not_compiled(kr6: Path) -> None:
    said = ran(kr6, "help arm_forward_kinematics; help arm_build_mex")
    assert "[position, rotation] = arm_forward_kinematics(q)" in said
    assert "rotation  1 x 3 x 3 x N, rotation matrices" in said
    assert "arm_build_mex('-O2')" in said
    (kr6 / "mex" / "arm_gravity.mex").rename(kr6 / "mex" / "kept")
    said = ran(kr6, "try; arm_gravity(1); catch e; disp(e.message); end")
    (kr6 / "mex" / "kept").rename(kr6 / "mex" / "arm_gravity.mex")
    assert said == "arm_gravity is not compiled: type arm_build_mex\n"


@octave
@pytest.mark.slow
def test_a_floating_base_and_wrenches(tmp_path: Path) -> None:
    (tmp_path / "hopper.urdf").write_text(HOPPER)
    robot = load_robot(tmp_path / "hopper.urdf", floating=True, frames=["trunk", "leg"])
    names = ["inverse_dynamics_with_wrenches", "integrate"]
    package = built(derive_model(robot.mechanism), tmp_path / "c", names, name="hopper")
    oracle, rng = reference(robot), np.random.default_rng(5)
    q, (qd, x) = rng.normal(size=(4, 8)), rng.normal(size=(2, 4, 7))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1)[:, None]
    wrenches = rng.normal(size=(4, 2, 6))
    given = {"q": q.T, "qd": qd.T, "x": x.T, "w": wrenches.transpose(1, 2, 0)}
    savemat(tmp_path / "in.mat", given)
    said = ran(
        package,
        f"""load('{tmp_path}/in.mat');
        tau = hopper_inverse_dynamics_with_wrenches(q, qd, x, w);
        save('-v7', '{tmp_path}/out.mat');
        q(7, 2) += 0.1;
        try; hopper_inverse_dynamics_with_wrenches(q, qd, x, w); catch e; disp(e.message); end
        q(7, 2) -= 0.1;
        try; hopper_inverse_dynamics_with_wrenches(q, qd, x, w(:, 1:5, :)); catch e; disp(e.message); end""",
    )
    near(loadmat(tmp_path / "out.mat")["tau"].T, oracle.inverse_dynamics(q, qd, x, wrenches))
    assert "q(4:7) of state 2 has length" in said
    assert "wrenches is 2 x 5 x 4, expected 2 x 6 x N" in said


@octave
@pytest.mark.slow
def test_single_precision_unknown_parameters_and_names(tmp_path: Path) -> None:
    """Names of files cannot leave their strings; S-functions need values."""
    urdf = (
        (ROBOTS / "rounded_arm.urdf")
        .read_text(encoding="utf-8")
        .replace('joint name="waist"', 'joint name="it\'s %d {é}"')
    )
    assert "é" in urdf
    (tmp_path / "arm.urdf").write_text(urdf, encoding="utf-8")
    model = psdmc.derive(tmp_path / "arm.urdf", unknown="all")
    package = built(model, tmp_path / "c", ["gravity"], real="float32", name="a'b\n%}")
    theta, q = bundled_model("rounded_arm").theta_b, np.array([0.3, -0.4, 0.9, 0.1, 0.5, -0.7])
    savemat(tmp_path / "in.mat", {"theta": theta[:, None].astype("f4"), "q": q[:, None].astype("f4")})
    said = ran(
        package,
        f"""load('{tmp_path}/in.mat'); info = a_b_info(); disp(info.joint_names{{1}});
        g = a_b_gravity(q, theta); disp(class(g)); printf('%.9g ', g);
        try; a_b_gravity(q); catch e; disp(e.message); end""",
    ).splitlines()
    assert said[:2] == ["it's %d {é}", "single"]
    values, _, message = said[2].partition("a_b")
    expected = reference(bundled_robot("rounded_arm")).gravity(q[None])[0]
    near(np.array(values.split(), float), expected, 1e-5)
    assert message == "_gravity: 1 arguments, expected q, theta_b"
    assert not list((package / "mex").glob("*_sfun.c"))


def block(package: Path, name: str, folder: Path) -> ctypes.CDLL:
    """An S-function with the interface in the folder `simulink`."""
    library, headers = folder / f"{name}.so", Path(__file__).parent / "simulink"
    command = [
        *find_compiler().command, "-std=c99", "-shared", "-fPIC", *STRICT.split(), "-DMATLAB_MEX_FILE",
        f"-I{headers}", f"-I{package / 'include'}", package / "mex" / f"{name}.c", *(package / "src").glob("*.c"),
        "-lm", "-o", library,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    loaded = ctypes.CDLL(str(library))
    loaded.outputs.restype = ctypes.c_char_p
    return loaded


def outputs(loaded: ctypes.CDLL, *signals: np.ndarray) -> bytes | None:
    places = (ctypes.c_void_p * len(signals))(*(signal.ctypes.data for signal in signals))
    return loaded.outputs(places)


def test_s_functions_are_pinocchio_s_dynamics(tmp_path: Path) -> None:
    functions = ["inverse_dynamics", "forward_dynamics", "mass_matrix", "neutral"]
    emit_c(bundled_model("scara"), tmp_path / "c", functions=functions, adapters="mex", name="arm")
    files = sorted(path.name for path in (tmp_path / "c" / "mex").glob("*_sfun.c"))
    assert files == ["arm_forward_dynamics_sfun.c", "arm_inverse_dynamics_sfun.c"]
    oracle, rng = reference(bundled_robot("scara")), np.random.default_rng(4)
    for name in functions[:2]:
        loaded, widths = block(tmp_path / "c", f"arm_{name}_sfun", tmp_path), (ctypes.c_int * 16)()
        assert loaded.start(1, widths) == -1, "an S-function without parameters was given one"
        assert loaded.start(0, widths) == 4
        assert widths[:4] == [4] * 4
        q, qd, x = rng.uniform(-1.0, 1.0, (3, 4))
        found = np.empty(4)
        assert outputs(loaded, q, qd, x, found) is None
        near(found, getattr(oracle, name)(q[None], qd[None], x[None])[0])
    q[:] = np.nan
    assert b"arm_forward_dynamics_sfun: a matrix" in (outputs(loaded, q, qd, x, found) or b"")


def test_gravity_is_the_last_port_of_an_s_function(tmp_path: Path) -> None:
    own = {"functions": "inverse_dynamics", "adapters": "mex", "gravity_input": True}
    emit_c(weighed_model("scara"), tmp_path / "c", name="arm", **own)  # type: ignore[arg-type]
    assert "arm_inverse_dynamics(q, qd, qdd, gravity, [theta_b])" in (
        tmp_path / "c" / "mex" / "arm_inverse_dynamics.m"
    ).read_text(encoding="utf-8")
    loaded, widths = block(tmp_path / "c", "arm_inverse_dynamics_sfun", tmp_path), (ctypes.c_int * 16)()
    assert loaded.start(0, widths) == 5
    assert widths[:5] == [4, 4, 4, 3, 4]
    (q, qd, qdd), pull = np.random.default_rng(4).uniform(-1.0, 1.0, (3, 4)), np.array([3.0, -2.0, 6.0])
    found, oracle = np.empty(4), under_gravity(reference(bundled_robot("scara")), pull)
    assert outputs(loaded, q, qd, qdd, pull, found) is None
    near(found, oracle.inverse_dynamics(q[None], qd[None], qdd[None])[0])


def test_long_names_are_refused_and_files_are_the_package_s_own(tmp_path: Path) -> None:
    arm = bundled_model("two_link")
    with pytest.raises(InputError, match="MATLAB allows names of at most 63 characters"):
        emit_c(arm, tmp_path / "c", functions="inverse_dynamics", adapters="mex", name="a" * 43)
    emit_c(arm, tmp_path / "c", functions="inverse_dynamics", adapters="mex", name="a" * 41)
    assert not compare_emitted(arm, tmp_path / "c")
    emit_c(arm, tmp_path / "c", functions="inverse_dynamics", name="a" * 41)
    assert not list((tmp_path / "c" / "mex").glob("*"))
