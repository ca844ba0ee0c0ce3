"""Compiled functions against the interpreted PROGRAM: every function, every form, precision and vector width."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from direct import Direct, error, expected, shared_library, states
from slow_cases import slow_but_for
from traced import SIZES, L, N, arm_kernels, arm_package

from psdmc.backends.info import EmitOptions
from psdmc.program.kernel import Kernel

KERNELS = arm_kernels()
TOLERANCE = {"float64": 1e-12, "float32": 2e-4}
VECTOR_FLAGS = {
    "widest": ["-march=native"],
    "widest on AMD": ["-march=native", "-D__znver3__"],
    "avx2": ["-mavx2", "-mfma"],
    "sse2": [],
    "plain": ["-Dtest_arm_NO_VECTORS"],
}
BUILDS = [
    ("float64", "inline", "widest"),
    ("float64", "inline", "widest on AMD"),
    ("float64", "inline", "avx2"),
    ("float64", "inline", "sse2"),
    ("float64", "inline", "plain"),
    ("float64", "libm", "widest"),
    ("float64", "freestanding", "widest"),
    ("float64", "freestanding", "plain"),
    ("float32", "inline", "widest"),
    ("float32", "inline", "sse2"),
]

QUICK = [
    ("float64", "inline", "widest"),
    ("float64", "libm", "widest"),
    ("float64", "freestanding", "plain"),
    ("float32", "inline", "sse2"),
]
"""Each kind of sine, each precision, vectors of several widths and none."""

OPTIMISED = {("float64", "inline", "widest"), ("float32", "inline", "widest")}
"""One of each precision shows what a compiler makes of the C; all show what the C says."""


def _cpu_has(feature: str) -> bool:
    info = Path("/proc/cpuinfo")
    return info.is_file() and f" {feature} " in info.read_text()


@pytest.fixture(scope="module", params=slow_but_for(QUICK, BUILDS), ids="-".join)
def compiled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Direct:
    real, trig, width = request.param
    if width == "avx2" and not _cpu_has("avx2"):
        pytest.skip("this CPU has no AVX2")
    package = arm_package(options=EmitOptions(real=real, trig=trig))
    flags = ["-O1" if request.param in OPTIMISED else "-O0", "-ffp-contract=fast", *VECTOR_FLAGS[width]]
    return Direct(package, shared_library(package, tmp_path_factory.mktemp("library"), flags))


def _given(compiled: Direct, kernel: Kernel, count: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Inputs as the package's reals, and what should come out for exactly these."""
    real = compiled.package.options.real
    given = {name: np.ascontiguousarray(v, real) for name, v in states(kernel, count, N, L).items()}
    return given, expected(kernel, given, N, L)


@pytest.mark.parametrize("name", KERNELS)
def test_one_state_gives_what_the_program_gives(compiled: Direct, name: str) -> None:
    kernel = KERNELS[name]
    given, reference = _given(compiled, kernel, 5)
    found = np.full(reference.shape, 99.0, compiled.package.options.real)

    for row in range(5):
        inputs = [given[v] if v == "theta_b" else given[v][row] for v in given]
        compiled(name, *inputs, found[row])

    assert error(found, reference) < TOLERANCE[compiled.package.options.real]


@pytest.mark.parametrize("name", KERNELS)
def test_a_batch_of_any_size_gives_what_the_program_gives(compiled: Direct, name: str) -> None:
    kernel = KERNELS[name]
    symbol = f"{kernel.function.name}_theta_batch" if kernel.theta else f"{name}_batch"
    for count in [*range(18), 33]:
        given, reference = _given(compiled, kernel, count)
        found = np.full((count + 1, reference.shape[1]), 99.0, compiled.package.options.real)

        compiled(symbol, count, *given.values(), found)

        assert error(found[:count], reference) < TOLERANCE[compiled.package.options.real]
        assert (found[count] == 99.0).all(), "wrote beyond the last row"


@pytest.mark.parametrize("name", [name for name, kernel in KERNELS.items() if not kernel.theta])
def test_states_that_lie_lane_by_lane_give_what_the_program_gives(compiled: Direct, name: str) -> None:
    lanes = compiled.package.lanes
    for count in (1, lanes, 2 * lanes + 3):
        given, reference = _given(compiled, KERNELS[name], count)
        blocks = -(-count // lanes)
        found = np.full((blocks, reference.shape[1], lanes), 99.0, compiled.package.options.real)

        compiled(f"{name}_batch_soa", count, *(_lane_by_lane(v, lanes) for v in given.values()), found)

        rows = found.transpose(0, 2, 1).reshape(blocks * lanes, -1)[:count]
        assert error(rows, reference) < TOLERANCE[compiled.package.options.real]


FAR = {"float64": 3e5, "float32": 3e3}
"""rad: beyond what the inline sine reaches by itself."""


@pytest.mark.parametrize("name", [name for name, kernel in KERNELS.items() if not kernel.theta])
def test_an_angle_that_takes_libm_changes_no_other_lane(compiled: Direct, name: str) -> None:
    """Far angles in some lanes, in several joints: every row as the PROGRAM has it, near ones bit for bit as without."""
    if compiled.package.options.trig == "freestanding":
        pytest.skip("no libm: see the test of NaN")
    real, lanes = compiled.package.options.real, compiled.package.lanes
    count, far = 2 * lanes, [1, lanes + 2, lanes + 3]
    given, _ = _given(compiled, KERNELS[name], count)
    near = np.empty((count, SIZES.size(KERNELS[name].function.outputs[0])), real)
    compiled(f"{name}_batch", count, *given.values(), near)
    given["q"][far] += np.asarray(FAR[real], real) * [[1, 0, 0, -2], [0, 1, 0, 0], [0, -1, 0, 3]]
    reference = expected(KERNELS[name], given, N, L)
    rows, blocks = np.empty_like(near), np.empty((2, near.shape[1], lanes), real)

    compiled(f"{name}_batch", count, *given.values(), rows)
    compiled(f"{name}_batch_soa", count, *(_lane_by_lane(v, lanes) for v in given.values()), blocks)

    assert error(rows, reference) < TOLERANCE[real]
    assert np.array_equal(blocks.transpose(0, 2, 1).reshape(count, -1), rows)
    assert np.array_equal(np.delete(rows, far, 0), np.delete(near, far, 0))


def test_without_libm_a_far_angle_gives_nan_in_its_own_lane(compiled: Direct) -> None:
    if compiled.package.options.trig != "freestanding":
        pytest.skip("with libm: see the test of its values")
    given, reference = _given(compiled, KERNELS["inverse_dynamics"], 20)
    given["q"][5, 1] = 3e5
    tau, one = np.empty((20, N)), np.empty(N)

    compiled("inverse_dynamics_batch", 20, *given.values(), tau)
    compiled("inverse_dynamics", *(v[5] for v in given.values()), one)

    assert np.isnan(tau[5, :2]).all()
    assert np.isnan(one[:2]).all()
    assert error(np.delete(tau, 5, 0), np.delete(reference, 5, 0)) < TOLERANCE["float64"]


def _lane_by_lane(rows: np.ndarray, lanes: int) -> np.ndarray:
    """[state][variable] -> [block][variable][lane], the last block filled up with zeros."""
    padded = np.zeros((-(-len(rows) // lanes) * lanes, rows.shape[1]), rows.dtype)
    padded[: len(rows)] = rows
    return np.ascontiguousarray(padded.reshape(-1, lanes, rows.shape[1]).transpose(0, 2, 1))


def test_the_output_may_be_an_input(compiled: Direct) -> None:
    real = compiled.package.options.real
    given, reference = _given(compiled, KERNELS["inverse_dynamics"], 19)
    for shared in ("q", "qd", "qdd"):
        one = {name: v[0].copy() for name, v in given.items()}
        compiled("inverse_dynamics", *one.values(), one[shared])
        assert error(one[shared], reference[0]) < TOLERANCE[real]

        rows = {name: v.copy() for name, v in given.items()}
        compiled("inverse_dynamics_batch", 19, *rows.values(), rows[shared])
        assert error(rows[shared], reference) < TOLERANCE[real]


@pytest.mark.parametrize("name", ["coriolis_matrix", "regressor"])
def test_a_matrix_may_overwrite_the_state_it_is_of(compiled: Direct, name: str) -> None:
    """Wherever in the output the inputs lie: a store before the last load would spoil some of them."""
    given, reference = _given(compiled, KERNELS[name], 1)
    size = reference.shape[1]
    for shift in range(0, size - len(given) * N + 1, 3):
        buffer = np.zeros(size, compiled.package.options.real)
        views = [buffer[start : start + N] for start in range(shift, shift + len(given) * N, N)]
        for view, values in zip(views, given.values(), strict=True):
            view[:] = values[0]

        compiled(name, *views, buffer)

        assert error(buffer, reference[0]) < TOLERANCE[compiled.package.options.real]


def _theta_with_no_inertia(joint: int) -> np.ndarray:
    """Parameters that make the joint's pivot negative: nothing but a negative drive inertia from there on."""
    theta = np.zeros(L)
    theta[10::11] = 1.0
    theta[11 * joint + 10] = -1.0
    return theta


@pytest.mark.parametrize("joint", range(N))
def test_forward_dynamics_names_the_joint_whose_pivot_is_not_positive(compiled: Direct, joint: int) -> None:
    real = compiled.package.options.real
    q, qd, tau = np.ones((3, N), real)
    qdd = np.zeros(N, real)

    status = compiled("forward_dynamics_theta", q, qd, tau, _theta_with_no_inertia(joint).astype(real), qdd)

    assert status == joint + 1
    assert np.isnan(qdd).all()


def test_a_nan_position_is_a_failure_too(compiled: Direct) -> None:
    real = compiled.package.options.real
    qd, tau, qdd = np.ones((3, N), real)

    assert compiled("forward_dynamics", np.full(N, np.nan, real), qd, tau, qdd) != 0
    assert np.isnan(qdd).all()


@pytest.mark.parametrize("count", [1, 7, 8, 9, 16, 35])
def test_a_batch_names_its_first_failing_row_and_computes_the_others(compiled: Direct, count: int) -> None:
    real = compiled.package.options.real
    kernel = KERNELS["forward_dynamics"]
    given, reference = _given(compiled, kernel, count)
    assert compiled("forward_dynamics_batch", count, *given.values(), np.empty((count, N), real)) == 0
    bad = sorted({count - 1, count // 2})
    given["q"][bad, 1] = np.nan
    qdd = np.empty((count, N), real)

    status = compiled("forward_dynamics_batch", count, *given.values(), qdd)

    assert status == bad[0] + 1
    reference[bad] = np.nan
    assert error(qdd, reference) < TOLERANCE[real] if count > 2 else np.isnan(qdd[bad]).all()


def test_tables_say_what_the_header_says(compiled: Direct) -> None:
    library, ffi = compiled.library, compiled.ffi
    names = [ffi.string(library.test_arm_joint_names[i]).decode() for i in range(N)]
    assert names == [f"joint {i}" for i in range(N)]
    assert [ffi.string(library.test_arm_joint_units[i]).decode() for i in range(N)] == [
        "rad",
        "rad",
        "m",
        "rad",
    ]
    assert list(library.test_arm_position_lower) == [-1.0] * N
    assert list(library.test_arm_acceleration_limit) == [np.inf] * N
    assert list(library.test_arm_gravity_acceleration) == pytest.approx([0, 0, -9.81])
    parameters = [p.value for p in compiled.package.info.parameters]
    assert list(library.test_arm_theta_b) == pytest.approx(parameters, rel=1e-6)
