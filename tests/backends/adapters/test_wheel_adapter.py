"""emit-c --with wheel: pip's wheel of a package, in an environment with nothing but NumPy, against Pinocchio."""

from __future__ import annotations

import os
import subprocess
import sys
import venv
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import ROBOTS, bundled_model, bundled_robot, under_gravity
from command_line import files_in
from installed import in_wheel

import psdmc
from psdmc.compiler import emit_c
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import load_robot
from psdmc.robot.reference import reference
from psdmc.toolchain.compiler_command import find_compiler

pytestmark = pytest.mark.skipif(find_spec("pip") is None, reason="pip is not installed")

FUNCTIONS = [
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "gravity",
    "forward_kinematics",
    "neutral",
]


def bare_environment(folder: Path) -> Path:
    """The Python of an environment that has NumPy alone."""
    venv.create(folder, with_pip=False, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    numpy = Path(np.__file__).parent
    for name in ("numpy", "numpy.libs"):
        if (numpy.parent / name).exists():
            (packages / name).symlink_to(numpy.parent / name)
    return folder / "bin" / "python"


def installed(package: Path, folder: Path) -> Path:
    """The Python of a bare environment into which pip put the package's wheel."""
    python = bare_environment(folder / "bare")
    environment = {
        **os.environ,
        "CC": " ".join(find_compiler().command),
        "CFLAGS": "-O0 -Wall -Wextra -Werror",
    }
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    built = [
        *pip,
        "wheel",
        "--no-build-isolation",
        "--no-deps",
        "--no-index",
        "-w",
        folder / "wheels",
        package,
    ]
    done = subprocess.run(built, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = (folder / "wheels").iterdir()
    assert "-cp311-abi3-" in wheel.name
    install = [*pip, "--python", python, "install", "--no-deps", "--no-index", wheel]
    subprocess.run(install, check=True, capture_output=True)
    return python


def ran(python: Path, program: str, cwd: Path) -> str:
    """What a program prints there: without a compiler, psdmc or Pinocchio."""
    done = subprocess.run(
        [python, "-I", "-W", "error", "-c", program],
        cwd=cwd,
        env={"PATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def kr6(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kr6")
    emit_c(bundled_model("kr6"), folder / "robot", functions=FUNCTIONS, adapters="wheel", name="arm")
    return installed(folder / "robot", folder)


def test_the_module_is_pinocchio_s_without_pinocchio(kr6: Path, tmp_path: Path) -> None:
    rng, oracle = np.random.default_rng(3), reference(bundled_robot("kr6"))
    q, qd, x = rng.uniform(-2.0, 2.0, (3, 70, 6))
    theta = np.asarray(bundled_model("kr6").theta_b)
    np.savez(tmp_path / "in.npz", q=q, qd=qd, x=x, theta=2 * theta)
    ran(
        kr6,
        """
import importlib.util, numpy, arm
assert not any(map(importlib.util.find_spec, ("psdmc", "pinocchio", "cffi")))
at = numpy.load("in.npz")
q, qd, x = at["q"], at["qd"], at["x"]
one = arm.inverse_dynamics(q[3].tolist(), qd[3], x[3])
assert one.shape == (6,) and (one == arm.inverse_dynamics(q, qd, x)[3]).all()
assert (arm.gravity(q.reshape(7, 10, 6))[2, 4] == arm.gravity(q[24])).all()
assert arm.mass_matrix(q[:0]).shape == (0, 6, 6) and (arm.neutral() == 0).all()
assert len(arm.JOINT_NAMES) == 6 and (2 * numpy.array(arm.THETA_B) == at["theta"]).all()
numpy.savez(
    "out.npz",
    tau=arm.inverse_dynamics(q, qd, x), qdd=arm.forward_dynamics(q, qd, x), M=arm.mass_matrix(q),
    strided=arm.gravity(numpy.asfortranarray(numpy.repeat(q, 2, 0))[::2]), twice=arm.gravity(q, theta_b=at["theta"]),
    wide=arm.inverse_dynamics(q[:, None], qd[None, :2], x[0]), rotation=arm.forward_kinematics(q).rotation,
)
""",
        tmp_path,
    )
    found = np.load(tmp_path / "out.npz")
    expected = {
        "tau": oracle.inverse_dynamics(q, qd, x),
        "qdd": oracle.forward_dynamics(q, qd, x),
        "M": oracle.mass_matrix(q),
        "strided": oracle.gravity(q),
        "twice": 2 * oracle.gravity(q),
        "rotation": oracle.poses(q, [oracle.tip_name])[:, :1, :3, :3],
    }
    many = [np.broadcast_to(v, (70, 2, 6)).reshape(-1, 6) for v in (q[:, None], qd[None, :2], x[0])]
    expected["wide"] = oracle.inverse_dynamics(*many).reshape(70, 2, 6)
    for name, values in expected.items():
        assert found[name].shape == values.shape, name
        assert np.abs(found[name] - values).max() <= 1e-10 * np.abs(values).max(), name


def test_gravity_and_many_arrays_are_inputs(tmp_path: Path) -> None:
    """Gravity stands before theta_b, one for all states or one for each. A function has more than 16 arrays."""
    many = "constrained_forward_dynamics_derivatives"
    model = psdmc.derive(in_wheel("hyq_no_sensors.urdf"), floating=True, contacts=["lf_foot"])
    emit_c(
        model,
        tmp_path / "c",
        functions=["inverse_dynamics", many],
        adapters="wheel",
        gravity_input=True,
        name="leg",
    )
    rng, sizes = np.random.default_rng(6), (model.nq, model.nv, model.nv)
    q, qd, x = (rng.uniform(-1.0, 1.0, (5, size)) for size in sizes)
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1)[:, None]
    pull = rng.uniform(-9.0, 9.0, (5, 3))
    np.savez(tmp_path / "in.npz", q=q, qd=qd, x=x, pull=pull, theta=3 * np.asarray(model.theta_b))
    ran(
        installed(tmp_path / "c", tmp_path),
        f"""
import numpy, leg
at = numpy.load("in.npz")
q, qd, x, pull = at["q"], at["qd"], at["x"], at["pull"]
found = leg.{many}(q, qd, x, numpy.ones((5, 1)), 0.0, numpy.zeros(1), numpy.zeros(1), numpy.zeros(3), pull)
numpy.savez(
    "out.npz", tau=leg.inverse_dynamics(q, qd, x, pull), one=leg.inverse_dynamics(q, qd, x, pull[2]),
    thrice=leg.inverse_dynamics(q, qd, x, pull, at["theta"]), qdd=found.qdd, forces=found.forces,
)
""",
        tmp_path,
    )
    found, oracle = (
        np.load(tmp_path / "out.npz"),
        reference(load_robot(in_wheel("hyq_no_sensors.urdf"), floating=True)),
    )
    rows = [tuple(part[k : k + 1] for part in (q, qd, x)) for k in range(5)]
    expected = np.vstack([under_gravity(oracle, pull[k]).inverse_dynamics(*rows[k]) for k in range(5)])
    assert np.abs(found["tau"] - expected).max() <= 1e-10 * np.abs(expected).max()
    assert np.abs(found["thrice"] - 3.0 * expected).max() <= 1e-10 * np.abs(expected).max()
    assert np.abs(found["one"][2] - expected[2]).max() <= 1e-10 * np.abs(expected).max()
    compiled = psdmc.compile(model, functions=[many], gravity_input=True)
    same = getattr(compiled, many)(q, qd, x, [1.0], gravity=pull, kp=0.0, kd=0.0)
    for name in ("qdd", "forces"):
        assert np.abs(found[name] - getattr(same, name)).max() <= 1e-9 * np.abs(found[name]).max()


WRONG = {
    "arm.inverse_dynamic": "AttributeError: arm has no function 'inverse_dynamic'; do you mean inverse_dynamics? psdmc",
    "arm.regressor": "AttributeError: arm has no function 'regressor'; it has inverse_dynamics, forward_dynamics, ",
    "arm._regressor": "AttributeError: arm has no attribute '_regressor'",
    "arm.gravity([0.0] * 5)": "ValueError: q has shape (5,), expected ('...', 6)",
    "arm.gravity(0.0)": "ValueError: q has shape (), expected ('...', 6)",
    "arm.gravity([1j] * 6)": "TypeError: q has dtype complex128, expected real numbers",
    "arm.gravity(['a'] * 6)": "TypeError: q has dtype <U1, expected real numbers",
    "arm.gravity(z, z)": "ValueError: theta_b has shape (6,), expected",
    "arm.inverse_dynamics(numpy.zeros((3, 6)), numpy.zeros((2, 6)), z)": "ValueError: shape mismatch",
    "arm.gravity(z, z, z)": "TypeError: gravity() takes from 1 to 2 positional arguments",
    "arm._c.gravity(2, z, z)": "ValueError: array 0 has 48 bytes, expected 2 states of 48",
    "arm._c.gravity(1, z, b'0' * 48)": "BufferError: Object is not writable.",
    "arm._c.gravity(-1, z, z)": "OverflowError",
    "arm._c.gravity(1, z)": "TypeError: 2 arguments, expected 3",
}


def test_wrong_arguments_are_python_s_own_errors(kr6: Path, tmp_path: Path) -> None:
    program = "import numpy, arm\nz = numpy.zeros(6)\n"
    for call in WRONG:
        program += f"try:\n    {call}\nexcept Exception as e:\n    print(type(e).__name__, e, sep=': ')\n"

    said = ran(kr6, program, tmp_path).splitlines()

    for line, expected in zip(said, WRONG.values(), strict=True):
        assert line.startswith(expected)


@pytest.mark.slow
def test_type_checkers_read_its_types(kr6: Path, tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text(
        "import arm\nreveal_type(arm.forward_kinematics([0.0]).rotation.dtype)\narm.gravity()\narm.gravity(q=1).shapes\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--python-executable", kr6, "--cache-dir=/dev/null", "user.py"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert 'Revealed type is "numpy.dtype[numpy.float64]"' in done.stdout
    assert 'user.py:3: error: Missing positional argument "q"' in done.stdout
    assert '"shapes"' in done.stdout
    assert "Found 2 errors in 1 file" in done.stdout


@pytest.mark.slow
def test_single_precision_and_unknown_parameters(tmp_path: Path) -> None:
    """A robot of no known inertias takes theta_b in each call; names of files cannot leave their strings."""
    source = ROBOTS / "rounded_arm.urdf"
    model = psdmc.derive(source, unknown="all")
    emit_c(
        model, tmp_path / "robot", functions="gravity", adapters="wheel", real="float32", name='a"\\\n"""b'
    )
    python = installed(tmp_path / "robot", tmp_path)
    np.save(tmp_path / "theta.npy", bundled_model("rounded_arm").theta_b)
    q = np.array([0.3, -0.4, 0.9, 0.1, 0.5, -0.7])
    text = ran(
        python,
        f"import numpy, a_b\ng = a_b.gravity({q.tolist()}, numpy.load('theta.npy'))\nprint(g.dtype, *map(float, g))",
        tmp_path,
    )
    name, *values = text.split()
    assert name == "float32"
    expected = reference(bundled_robot("rounded_arm")).gravity(q[None])[0]
    assert np.abs(np.array(values, float) - expected).max() < 1e-5 * np.abs(expected).max()


@pytest.mark.parametrize("name", ["lambda", "json", "numpy"])
def test_names_of_python_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=f"a Python module cannot be called '{name}'"):
        emit_c(bundled_model("two_link"), tmp_path / "c", functions="gravity", adapters="wheel", name=name)
    assert not (tmp_path / "c").exists()


def test_files_of_the_user_s_stay_and_files_of_an_adapter_go(tmp_path: Path) -> None:
    arm, folder = bundled_model("two_link"), tmp_path / "arm"
    emit_c(arm, folder, functions="gravity")
    before = files_in(folder)
    (folder / "setup.py").write_text("mine")
    with pytest.raises(InputError, match=r"not overwriting setup\.py"):
        emit_c(arm, folder, functions="gravity", adapters="wheel")
    assert files_in(folder) == {**before, "setup.py": b"mine"}
    (folder / "setup.py").unlink()

    emit_c(arm, folder, functions="gravity", adapters=["wheel", "fmu", "casadi"])
    assert (folder / "fmu" / "pack.py").exists()
    emit_c(arm, folder, functions="gravity")

    assert files_in(folder) == before


@pytest.mark.slow
def test_hyq_on_its_floating_base(tmp_path: Path) -> None:
    urdf = in_wheel("hyq_no_sensors.urdf")
    model: DynamicsModel = psdmc.derive(urdf, floating=True)
    emit_c(model, tmp_path / "robot", functions=FUNCTIONS, adapters="wheel", name="hyq")
    python = installed(tmp_path / "robot", tmp_path)
    oracle = pin.buildModelFromUrdf(str(urdf), pin.JointModelFreeFlyer())
    data, rng = oracle.createData(), np.random.default_rng(7)
    q = pin.normalize(oracle, rng.uniform(-1.0, 1.0, oracle.nq))
    qd, x = rng.uniform(-1.0, 1.0, (2, oracle.nv))
    np.savez(tmp_path / "in.npz", q=q, qd=qd, x=x)
    text = ran(
        python,
        """
import numpy, hyq
at = numpy.load("in.npz")
given = [at[name] for name in ("q", "qd", "x")]
numpy.savez("out.npz", tau=hyq.inverse_dynamics(*given), qdd=hyq.forward_dynamics(*given))
try:
    hyq.gravity(2 * at["q"])
except ValueError as error:
    print(error)
""",
        tmp_path,
    )
    assert text == "q[3:7] has a length other than 1\n"
    found = np.load(tmp_path / "out.npz")
    for name, expected in {
        "tau": pin.rnea(oracle, data, q, qd, x),
        "qdd": pin.aba(oracle, data, q, qd, x),
    }.items():
        assert np.abs(found[name] - expected).max() <= 1e-10 * np.abs(expected).max()
