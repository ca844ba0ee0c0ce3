"""psdmc.compile(model, target="cuda") against Pinocchio. A library in shim/ stands for NVRTC and the driver: it compiles the
same source for the CPU, and runs kernels when their stream is waited for. No test has run on a GPU."""

from __future__ import annotations

import ctypes
import json
import pickle
import runpy
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model, bundled_robot
from on_a_cpu import FLAGS, SHIM

import psdmc
from psdmc.errors import InputError, ToolchainError
from psdmc.lower import kernels
from psdmc.robot.reference import reference
from psdmc.toolchain import cuda_libraries
from psdmc.toolchain.cuda_libraries import Driver
from psdmc.toolchain.cuda_robot import CudaRobot, DeviceArray

pytestmark = pytest.mark.needs("g++")

STATES, EXACT, SOLVED = 200, 1e-12, 1e-10
"""More states than a block has, and errors relative to the largest value. SOLVED: where the mass matrix is inverted."""

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"
STREAM = 7
FUNCTIONS = ("inverse_dynamics", "forward_dynamics", "semi_implicit_euler", "forward_kinematics")


@pytest.fixture(scope="module")
def gpus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Two GPUs of the fake driver."""
    folder = tmp_path_factory.mktemp("fake")
    library = folder / "libfake.so"
    source = ["g++", "-std=c++14", "-O1", "-Wall", "-Werror", "-shared", "-fPIC", SHIM / "fake_cuda.cpp"]
    subprocess.run([*source, "-o", library, "-ldl"], check=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FAKE_CUDA_FOLDER", str(folder))
        patch.setenv("FAKE_CUDA_CXX", " ".join(["g++", *FLAGS, "-O0", "-shared", "-fPIC", "-xc++"]))
        patch.setattr(cuda_libraries, "DRIVERS", (str(library),))
        patch.setattr(cuda_libraries, "_candidates", lambda: iter([str(library)]))
        forget()
        yield
    forget()


def forget() -> None:
    for opened in (cuda_libraries.driver_library, cuda_libraries.compiler):
        opened.cache_clear()


@pytest.fixture(scope="module")
def robot(gpus: None) -> CudaRobot:
    return psdmc.compile(bundled_model("scara"), functions=FUNCTIONS, target="cuda")


class Foreign:
    """An array of another library, with the CUDA array interface alone; `more` replaces its entries."""

    def __init__(self, array: Any, ordinal: int = 0, **more: Any) -> None:
        self.kept = DeviceArray.of(Driver(ordinal), np.asarray(array))
        face = self.kept.__cuda_array_interface__
        del face["stream"]
        self.__cuda_array_interface__ = face | {"version": 2, "strides": None} | more


class ByDlpack:
    """An array of another library with DLPack alone. NumPy makes the capsule, in which the device is changed."""

    def __init__(self, array: Any, device: int = 2) -> None:
        self.array, self.device, self.stream = Foreign(array), device, -1

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.device, 0

    def __dlpack__(self, stream: int) -> Any:
        face = self.array.__cuda_array_interface__
        self.stream, kind = stream, np.ctypeslib.as_ctypes_type(np.dtype(face["typestr"]))
        memory = ctypes.cast(face["data"][0], ctypes.POINTER(kind))
        capsule = np.ctypeslib.as_array(memory, face["shape"]).__dlpack__()
        place = ctypes.pythonapi.PyCapsule_GetPointer
        place.restype, place.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
        ctypes.c_int32.from_address(place(capsule, b"dltensor") + 8).value = self.device
        return capsule


@pytest.fixture(scope="module")
def motion() -> dict[str, np.ndarray]:
    """States of the arm with three revolute joints and one that slides, and Pinocchio's results."""
    q, qd, qdd = np.random.default_rng(3).uniform(-2.0, 2.0, (3, STATES, 4))
    tau = reference(bundled_robot("scara")).inverse_dynamics(q, qd, qdd)
    return {"q": q, "qd": qd, "qdd": qdd, "tau": tau}


def near(found: np.ndarray, expected: np.ndarray, limit: float) -> bool:
    return found.shape == expected.shape and bool(abs(found - expected).max() <= limit * abs(expected).max())


@pytest.mark.parametrize("kind", [Foreign, ByDlpack])
@pytest.mark.parametrize("lead", [(), (1,), (STATES,), (2, STATES // 2), (0, 3)])
def test_results_are_pinocchios(robot: CudaRobot, motion: Any, kind: Any, lead: tuple[int, ...]) -> None:
    states = int(np.prod(lead))
    own = {name: array[:states].reshape(*lead, 4) for name, array in motion.items()}
    given = {name: kind(array) for name, array in own.items()}

    tau = robot.inverse_dynamics(given["q"], given["qd"], qdd=given["qdd"])
    qdd = robot.forward_dynamics(given["q"], given["qd"], given["tau"])

    assert tau.shape == (*lead, 4)
    if states:
        assert near(tau.numpy(), own["tau"], EXACT)
        assert near(qdd.numpy(), own["qdd"], SOLVED)


def test_theta_b_and_numbers_are_copied(robot: CudaRobot, motion: Any) -> None:
    q, qd, qdd = (Foreign(motion[name]) for name in ("q", "qd", "qdd"))
    for theta in (2 * robot.theta_b, list(2 * robot.theta_b), Foreign(2 * robot.theta_b)):
        assert near(robot.inverse_dynamics(q, qd, qdd, theta_b=theta).numpy(), 2 * motion["tau"], EXACT)

    after = robot.semi_implicit_euler(q, qd, Foreign(motion["tau"]), 0.01)

    rates = motion["qd"] + 0.01 * motion["qdd"]
    assert near(after.qd_next.numpy(), rates, SOLVED)
    assert near(after.q_next.numpy(), motion["q"] + 0.01 * rates, SOLVED)


def test_each_state_has_its_own_theta_b_and_gravity(gpus: None) -> None:
    names = ("inverse_dynamics_theta_rows", "gravity")
    robot: Any = psdmc.compile(
        bundled_model("two_link"), functions=names, target="cuda", gravity_input=True, real="float64"
    )
    rng = np.random.default_rng(5)
    q, qd, qdd = rng.uniform(-2.0, 2.0, (3, STATES, 2))
    gravity, scale = rng.uniform(-9.0, 9.0, (STATES, 3)), rng.uniform(0.5, 2.0, (STATES, 1))
    other = reference(bundled_robot("two_link")).model.copy()
    data = other.createData()
    expected, held = np.empty_like(q), np.empty_like(q)
    for k in range(STATES):
        other.gravity.linear = gravity[k]
        expected[k] = scale[k] * pin.rnea(other, data, q[k], qd[k], qdd[k])
        held[k] = pin.computeGeneralizedGravity(other, data, q[k])
    thetas, states = scale * robot.theta_b, [Foreign(each) for each in (q, qd, qdd)]

    for theta in (thetas, Foreign(thetas)):
        tau = robot.inverse_dynamics(*states, theta_b=theta, gravity=Foreign(gravity))
        assert near(tau.numpy(), expected, EXACT)
    assert near(robot.gravity(states[0], gravity=gravity).numpy(), held, EXACT)
    same = robot.gravity(Foreign(q[:1]), gravity=gravity[0].tolist()).numpy()
    assert near(same, held[:1], EXACT)
    at_rest = robot.inverse_dynamics(*states, theta_b=thetas).numpy()
    other.gravity.linear = robot.gravity_acceleration
    own = [pin.rnea(other, data, *each) for each in zip(q, qd, qdd, strict=True)]
    assert near(at_rest, scale * np.array(own), EXACT)

    with pytest.raises(InputError, match=r"^inverse_dynamics: theta_b has shape \(2, \d\), expected \(200, "):
        robot.inverse_dynamics(*states, theta_b=thetas[:2])
    with pytest.raises(InputError, match=r"^gravity: gravity has shape \(2,\), expected \(200, 3\)"):
        robot.gravity(states[0], gravity=[0.0, 9.81])


def test_results_go_into_given_arrays(robot: CudaRobot, motion: Any) -> None:
    q = Foreign(motion["q"])
    outs = (Foreign(np.zeros((STATES, 1, 3))), Foreign(np.zeros((STATES, 1, 3, 3))))

    found = robot.forward_kinematics(q, out=outs)

    assert found.position is outs[0]
    assert found.rotation is outs[1]
    own = robot.forward_kinematics(q)
    for given, array in zip(outs, own, strict=True):
        assert (given.kept.numpy() == array.numpy()).all()
    turned = own.rotation.numpy()[:, 0]
    assert np.abs(turned @ turned.transpose(0, 2, 1) - np.eye(3)).max() < EXACT


def test_streams_are_waited_for(robot: CudaRobot, motion: Any) -> None:
    """A result that another stream still computes is an input: its interface names the stream."""
    q, qd, qdd, tau = (Foreign(motion[name]) for name in ("q", "qd", "qdd", "tau"))
    early = robot.inverse_dynamics(q, qd, qdd, stream=STREAM)
    memory = (ctypes.c_double * 4).from_address(early.__cuda_array_interface__["data"][0])
    assert np.isnan(memory).all()  # not computed yet

    class Stream:
        cuda_stream = STREAM

    assert near(robot.forward_dynamics(q, qd, early).numpy(), motion["qdd"], SOLVED)
    same = robot.forward_dynamics(q, qd, robot.inverse_dynamics(q, qd, qdd, stream=Stream()), stream=STREAM)
    assert same.stream == STREAM
    assert near(same.numpy(), motion["qdd"], SOLVED)
    capsule = ByDlpack(motion["q"])
    robot.inverse_dynamics(capsule, qd, tau, stream=STREAM)
    assert capsule.stream == STREAM


def test_a_state_whose_matrix_is_not_positive_is_nan(robot: CudaRobot, motion: Any) -> None:
    q = motion["q"].copy()
    q[5] = np.nan
    found = robot.forward_dynamics(Foreign(q), Foreign(motion["qd"]), Foreign(motion["tau"])).numpy()
    assert list(np.flatnonzero(np.isnan(found).any(1))) == [5]


def test_others_are_compiled_later_and_in_float32(gpus: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        kernels, "default_of", lambda robot: ("gravity",)
    )  # g++ takes long for all default functions
    model = bundled_model("two_link")
    robot: Any = psdmc.compile(model, target="cuda:1", real="float32")
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 2)).astype(np.float32)
    assert "kinetic_energy" not in robot.functions

    found = robot.kinetic_energy(Foreign(q, 1), Foreign(q, 1))

    mass = reference(bundled_robot("two_link")).mass_matrix(q.astype(np.float64))
    assert near(found.numpy(), np.einsum("si,sij,sj->s", q, mass, q) / 2, 1e-5)
    assert found.dtype == np.float32
    assert repr(robot).startswith("CudaRobot 'two_link': 2 joints, float32")
    assert repr(found) == "DeviceArray (3,) float32 on GPU 1"


def test_the_benchmark_compares_and_times(
    gpus: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Times of the fake driver mean nothing."""
    bench = runpy.run_path(str(BENCHMARKS / "accelerator.py"))
    own = bench["main"].__globals__
    names = ("inverse_dynamics", "forward_dynamics")
    changed = {"FUNCTIONS": names, "TIMED": names, "SHORTEST": 1e-4, "COMPARED": 150}
    changed["models"] = lambda given: [("two_link", bundled_model("two_link"))]
    models = own["models"]
    for key, value in changed.items():
        monkeypatch.setitem(own, key, value)
    words = ["--batches", "130", "--copy", "4096", "--json", str(tmp_path / "found.json")]

    assert bench["main"](words) == 0
    said, rows = capsys.readouterr().out, json.loads((tmp_path / "found.json").read_text())["rows"]
    assert "GPU no GPU; a copy reads and writes" in said
    assert {row["layout"] for row in rows} == {"rows", "states", "method"}
    assert [row["bytes per state"] for row in rows] == [4 * 8] * 6 + [8 * 8] * 6

    monkeypatch.setitem(own, "EXACT", {"float32": 1e-12, "float64": 1.0})
    assert bench["main"](words) == 1
    assert "WRONG" in capsys.readouterr().out
    monkeypatch.setitem(own, "models", models)
    assert bench["main"](["KR6"]) == 2
    assert "there is no robot 'KR6'" in capsys.readouterr().err


WRONG = {
    "list": (lambda q: [0.0] * 4, "q is a list in the CPU's memory"),
    "numpy": (lambda q: q, "q is a ndarray in the CPU's memory, expected an array in the memory of the GPU"),
    "dlpack of the CPU": (lambda q: ByDlpack(q, 1), "q is a ByDlpack in the CPU's memory"),
    "address of the CPU": (lambda q: Foreign(q, data=(q.ctypes.data, False)), "q is in the CPU's memory, expected GPU 0"),
    "other GPU": (lambda q: Foreign(q, 1), "q is on GPU 1, expected GPU 0"),
    "float32": (lambda q: Foreign(q.astype(np.float32)), "q has dtype float32, expected float64"),
    "dlpack float32": (lambda q: ByDlpack(q.astype(np.float32)), "q has dtype float32, expected float64"),
    "integers": (lambda q: ByDlpack(q.astype(np.int64)), "q has dtype int64, expected float64"),
    "shape": (lambda q: Foreign(q[:, :3].copy()), r"q has shape \(200, 3\), expected \(200, 4\)"),
    "no axes": (lambda q: Foreign(q[0, 0]), r"q has shape \(\), expected \(4,\)"),
    "leading axes": (lambda q: Foreign(q[:3].copy()), r"qd has shape \(200, 4\), expected \(3, 4\)"),
    "strides": (lambda q: Foreign(q, strides=(8, 1600)), r"q has strides \(8, 1600\), expected contiguous rows"),
    "number": (lambda q: 0.5, r"q has shape \(\), expected \(200, 4\)"),
}  # fmt: skip
"""What is given instead of q (200, 4); the error."""


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_arrays_are_refused_by_name(robot: CudaRobot, motion: Any, wrong: str) -> None:
    make, message = WRONG[wrong]
    other = Foreign(motion["qd"])
    with pytest.raises(InputError, match=f"^inverse_dynamics: {message}") as caught:
        robot.inverse_dynamics(make(motion["q"]), other, other)
    assert "\n" not in caught.value.message
    assert caught.value.hint


def test_wrong_calls_are_refused(robot: CudaRobot, motion: Any) -> None:
    q = Foreign(motion["q"])
    with pytest.raises(InputError, match=r"^inverse_dynamics: theta_b has shape \(3,\), expected"):
        robot.inverse_dynamics(q, q, q, theta_b=np.zeros(3))
    fixed = Foreign(motion["q"])
    fixed.__cuda_array_interface__["data"] = (fixed.__cuda_array_interface__["data"][0], True)
    with pytest.raises(InputError, match=r"^inverse_dynamics: out is read-only"):
        robot.inverse_dynamics(q, q, q, out=fixed)
    with pytest.raises(InputError, match=r"^forward_kinematics: out has 1 arrays, expected 2"):
        robot.forward_kinematics(q, out=q)
    with pytest.raises(InputError, match=r"^stream is a str"):
        robot.inverse_dynamics(q, q, q, stream="0")
    with pytest.raises(InputError, match="inverse_dynamics_theta_rows was not compiled for the GPU"):
        robot.inverse_dynamics(q, q, q, theta_b=np.ones((STATES, robot.l)))
    with pytest.raises(InputError, match="has no input gravity"):
        robot.inverse_dynamics(q, q, q, gravity=q)
    with pytest.raises(InputError, match="gravity was not compiled for the GPU"):
        robot.gravity(q)
    with pytest.raises(
        AttributeError, match=r"^CudaRobot has no function 'inverse_dynamic'; do you mean inverse_dyn"
    ):
        robot.inverse_dynamic  # noqa: B018
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(robot)
    with pytest.raises(TypeError, match=r"^inverse_dynamics\(\): missing"):
        robot.inverse_dynamics(q)


def test_wrong_targets_are_refused(gpus: None, monkeypatch: pytest.MonkeyPatch) -> None:
    model = bundled_model("two_link")
    for target, message in {"cuda:2": "no GPU 2: the driver finds 2", "cuda:x": "target is 'cuda:x'"}.items():
        with pytest.raises(InputError, match=message):
            psdmc.compile(model, target=target)
    with pytest.raises(InputError, match=r"target 'cuda' has no option friction"):
        psdmc.compile(model, target="cuda", friction=True)
    monkeypatch.setenv("FAKE_CUDA_BROKEN", "1")
    with pytest.raises(
        ToolchainError, match=r"^cuInit: the driver of the GPU says: an error of the fake driver"
    ):
        psdmc.compile(model, target="cuda")


@pytest.mark.parametrize("missing", ["driver", "NVRTC"])
def test_what_is_not_installed_is_said(gpus: None, missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cuda_libraries, "DRIVERS", () if missing == "driver" else cuda_libraries.DRIVERS)
    monkeypatch.setattr(cuda_libraries, "_candidates", lambda: iter(["libnone.so"]))
    forget()
    message = {"driver": '^target "cuda" needs an NVIDIA GPU', "NVRTC": '^target "cuda" needs NVRTC'}[missing]
    with pytest.raises(ToolchainError, match=message) as caught:
        psdmc.compile(bundled_model("two_link"), functions="gravity", target="cuda")
    forget()
    assert caught.value.hint
