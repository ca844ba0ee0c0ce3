"""CUDA packages on a CPU: kernels agree with reference values and with Pinocchio, and bad input is refused."""

from __future__ import annotations

import ctypes
import re
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import bundled_model
from command_line import typed
from on_a_cpu import Library, compiled, passed, self_test
from pinocchio_robots import path_of

import psdmc
from psdmc.backends.c import make_kernel_view
from psdmc.backends.cuda.back_end import identifier
from psdmc.compiler import compare_emitted, emit
from psdmc.functions import DEFAULT, DEFAULT_WHERE_WIDE, OF_TREES, RECIPES

EVIL = 'a*/ #error "x" \\\n??/ \u202e int main() {} //'
"""A robot's name."""

BLOCK = 128
STATES = 2 * BLOCK + 5
"""Two blocks and a part of one."""

ROUNDED = 1e-10
"""Share of the largest torque: `derive` rounds numbers of the model."""

DERIVATIVES = ("inverse_dynamics_derivatives", "forward_dynamics_derivatives", "forward_dynamics_vjp")

pytestmark = pytest.mark.needs("g++")


def forms(names: tuple[str, ...]) -> int:
    """Functions of these names, baked and with theta_b."""
    return sum(1 + RECIPES[name].signature.theta for name in names)


@pytest.mark.parametrize("real", ["float64", "float32"])
@pytest.mark.parametrize("name", ["scara", pytest.param("kr6", marks=pytest.mark.slow)])
def test_of_arms(name: str, real: str, tmp_path: Path) -> None:
    names = (*DEFAULT, *DERIVATIVES)
    emit(bundled_model(name), tmp_path, "cuda", functions=names, real=real)  # type: ignore[arg-type]

    assert passed(self_test(tmp_path)) == forms(names)


@pytest.mark.slow
def test_every_function_of_a_small_robot(tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "cuda", functions=OF_TREES)

    assert passed(self_test(tmp_path)) == forms(OF_TREES)


def test_each_state_has_its_own_theta_b(tmp_path: Path) -> None:
    names = ("inverse_dynamics", "forward_dynamics", "mass_matrix")
    rows = tuple(f"{name}_theta_rows" for name in names)
    emit(bundled_model("two_link"), tmp_path, "cuda", functions=(*names, *rows))

    assert passed(self_test(tmp_path)) == forms(names) + len(rows)
    header = next(tmp_path.glob("include/*/*.cuh")).read_text(encoding="utf-8")
    assert "_inverse_dynamics_thetas_rows(const real *__restrict__ q" in header


def test_loops_calls_and_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Forms that long functions have, of an arm."""
    monkeypatch.setattr(make_kernel_view, "LONG", 300)
    monkeypatch.setattr(make_kernel_view, "PART", 100)
    names = ("forward_dynamics_derivatives", "rk4_step_derivatives")

    emit(bundled_model("kr6"), tmp_path, "cuda", functions=names)

    text = (tmp_path / "include" / "kr6" / "kr6.cuh").read_text()
    assert all(word in text for word in ("for (size_t round_1", "PART(1)(", "MINUS_PRODUCT_0(dqdd"))
    assert passed(self_test(tmp_path)) == forms(names)


@pytest.mark.slow
@pytest.mark.parametrize("real", ["float64", "float32"])
def test_of_a_floating_base(real: str, tmp_path: Path) -> None:
    names = (*DEFAULT_WHERE_WIDE, *DERIVATIVES)
    emit(psdmc.derive(path_of("hyq"), floating=True), tmp_path, "cuda", functions=names, real=real)  # type: ignore[arg-type]

    assert passed(self_test(tmp_path)) == forms(names)


def test_against_pinocchio(tmp_path: Path) -> None:
    path = path_of("ur10")
    model = psdmc.derive(path)
    emit(model, tmp_path, "cuda", functions=["inverse_dynamics", "forward_dynamics"])
    library = Library(tmp_path, np.float64)
    theirs = pin.buildModelFromUrdf(path)
    q, qd, qdd = np.random.default_rng(3).uniform(-2.0, 2.0, (3, STATES, 6))
    data = theirs.createData()
    tau = np.array([pin.rnea(theirs, data, *state) for state in zip(q, qd, qdd, strict=True)])

    for layout in ("states", "rows"):
        for count in (1, BLOCK, STATES):
            status = np.full(count, 9, np.int32)
            motion, torque = [q[:count], qd[:count], qdd[:count]], [q[:count], qd[:count], tau[:count]]
            (found,) = library("inverse_dynamics", layout, motion, 6)
            (with_theta,) = library("inverse_dynamics_theta", layout, motion, 6, theta=model.theta_b)
            (accelerations,) = library("forward_dynamics", layout, torque, 6, status=status)
            np.testing.assert_allclose(found, tau[:count], rtol=0.0, atol=ROUNDED * abs(tau).max())
            np.testing.assert_allclose(with_theta, tau[:count], rtol=0.0, atol=ROUNDED * abs(tau).max())
            np.testing.assert_allclose(accelerations, qdd[:count], rtol=0.0, atol=1e-6)
            assert not status.any()


def test_a_state_whose_matrix_is_not_positive(tmp_path: Path) -> None:
    """A negative mass of the second joint: its accelerations are NaN, the status is the number of the first such pivot,
    and neighbouring states are right."""
    model = bundled_model("two_link")
    emit(model, tmp_path, "cuda", functions=["forward_dynamics"])
    library = Library(tmp_path, np.float64)
    q, qd, tau = np.random.default_rng(1).uniform(-1.0, 1.0, (3, STATES, 2))
    q[BLOCK + 1] = np.nan
    for layout in ("states", "rows"):
        status = np.full(STATES, 9, np.int32)
        (good,) = library("forward_dynamics", layout, [q, qd, tau], 2, status=status)
        assert list(np.flatnonzero(status)) == list(np.flatnonzero(np.isnan(good).all(1))) == [BLOCK + 1]
        assert np.isfinite(np.delete(good, BLOCK + 1, 0)).all()

        (bad,) = library(
            "forward_dynamics_theta", layout, [q, qd, tau], 2, theta=-model.theta_b, status=status
        )
        assert np.isnan(bad).all()
        assert set(status) == {1}


def test_sizes_that_no_grid_has(tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "cuda", functions=["gravity"])
    launch = Library(tmp_path, np.float64).dll["two_link_gravity_rows_launch"]

    assert launch(None, None, ctypes.c_longlong(0), None) == 0
    assert launch(None, None, ctypes.c_longlong(-1), None) == 1
    assert launch(None, None, ctypes.c_longlong(BLOCK * 2**31), None) == 1


@pytest.mark.parametrize("word", ["wrong number", "no wait before", "no wait behind"])
def test_wrong_code_is_noticed(word: str, tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "cuda", functions=["inverse_dynamics"])
    file = tmp_path / "include" / "two_link" / "two_link.cuh"
    text = file.read_text()
    body = text.index("double")
    changed = {
        "wrong number": text[:body] + re.sub(r"([1-9]\.\d+)", r"1.0001 * \1", text[body:], count=1),
        "no wait before": text.replace("__syncthreads();", "", 1),
        "no wait behind": text.replace("__syncthreads();", ";", 2).replace(";;", "__syncthreads();", 1),
    }[word]
    assert changed != text
    file.write_text(changed)

    assert "FAILED" in self_test(tmp_path).stdout


def test_a_name_that_is_code(tmp_path: Path) -> None:
    emit(bundled_model("two_link"), tmp_path, "cuda", functions=["gravity"], name=EVIL)

    assert passed(self_test(tmp_path)) == 2


def test_names() -> None:
    assert {identifier(word) for word in ("cuda", "CUDART", "float")} == {
        *("robot_cuda", "robot_CUDART", "robot_float")
    }
    assert identifier("KR6 R900") == "KR6_R900"


def test_the_command(tmp_path: Path) -> None:
    psdmc.save(bundled_model("two_link"), tmp_path / "m.npz")
    words = (
        "emit",
        "m.npz",
        "--backend",
        "cuda",
        "--functions",
        "gravity",
        "--real",
        "float32",
        "--name",
        "cuda",
        "-o",
        "p",
    )

    done = typed(*words, cwd=tmp_path)

    assert done.returncode == 0, done.stderr
    assert "p/include/robot_cuda/robot_cuda.cuh: the header" in done.stdout
    assert "note: the CUDA name of 'cuda' is robot_cuda" in done.stdout
    assert "next: cmake -S p -B p/build && cmake --build p/build" in done.stderr
    assert "nothing changed" in typed(*words, cwd=tmp_path).stdout
    assert not compare_emitted(tmp_path / "m.npz", tmp_path / "p")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--payload",), "cuda has no --payload.*\n.*emit-c"),
        (("--with", "wheel"), "cuda has no --with"),
        (("--target", "scalar"), "cuda has no --target"),
        (("--trig", "libm"), "cuda has no --trig"),
        (("--real", "float16"), "real is 'float16'"),
        (("--functions", "x"), "x"),
    ],
)
def test_what_is_refused(words: tuple[str, ...], said: str, tmp_path: Path) -> None:
    psdmc.save(bundled_model("two_link"), tmp_path / "m.npz")

    done = typed("emit", "m.npz", "--backend", "cuda", "-o", "out", *words, cwd=tmp_path)

    assert done.returncode == 2
    assert re.search(said, done.stderr)
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_the_program_of_the_page(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "cuda.md").read_text(encoding="utf-8")
    emit(bundled_model("scara"), tmp_path, "cuda", name="arm")
    (program,) = re.findall(r"```cpp file=app.cu\n(.*?)```", page, re.DOTALL)
    (kernel,) = re.findall(r"```cpp\n(.*?)```", page, re.DOTALL)
    (tmp_path / "app.cu").write_text(f"{program}\n{kernel}")

    app = compiled(tmp_path, [tmp_path / "src" / "arm.cu", tmp_path / "app.cu"], "app", "-O1")

    printed = subprocess.run([app], capture_output=True, text=True, check=True).stdout.strip()
    assert f"It prints `{printed}`." in page


@pytest.mark.slow
@pytest.mark.needs("nvcc", "cmake")
def test_cmake_and_nvcc(tmp_path: Path) -> None:
    """They build the package; where there is no GPU, the self-test says so."""
    emit(bundled_model("two_link"), tmp_path, "cuda", functions=["gravity", "forward_dynamics"])
    for words in (("-S", ".", "-B", "build"), ("--build", "build")):
        done = subprocess.run(["cmake", *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr

    run = subprocess.run(
        [tmp_path / "build" / "two_link_self_test"], capture_output=True, text=True, check=False
    )

    assert run.returncode == 0 or (run.returncode == 2 and run.stdout.startswith("CUDA: "))
