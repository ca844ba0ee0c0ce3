"""A signature with everything that one may have: a scalar, vectors, matrices, inputs of other sizes, a condition."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from direct import Direct, all_expected, error, shared_library, states
from odd_package import FRAMES, FUNCTION, INFO, KERNELS, L, N
from odd_package import odd_package as package
from unoptimised import compiled as library
from unoptimised import wrapper

from psdmc.backends.c.back_end import package_files
from psdmc.backends.c.package import package_view
from psdmc.backends.info import EmitOptions
from psdmc.backends.package_folder import write_package
from psdmc.backends.reference_states import ReferenceStates
from psdmc.errors import InputError, InternalError
from psdmc.program.kernel import Kernel
from psdmc.program.signature import Quantity
from psdmc.program.trace import Slot, Tracer
from psdmc.toolchain.build_package import build_package
from psdmc.toolchain.compiled_functions import CompiledFunctions
from psdmc.toolchain.interface import interface_of

BUILDS = {"vectors": ["-march=native"], "sse2": ["-g0"], "plain": ["-Dodd_NO_VECTORS"]}


def given_at(kernel: Kernel, count: int, bad: tuple[int, ...] = ()) -> dict[str, np.ndarray]:
    """Random inputs; in the rows `bad` the second joint has no pivot."""
    given = states(kernel, count, N, L, frames=FRAMES)
    given["q"][list(bad), 1] = np.nan
    return given


@pytest.fixture(scope="module", params=[("float64", "vectors"), ("float64", "plain"), ("float32", "sse2")])
def compiled(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Direct:
    real, build = request.param
    folder = tmp_path_factory.mktemp("everything")
    optimised = "-O1" if build == "vectors" else "-O0"
    return Direct(package(real), shared_library(package(real), folder, [optimised, *BUILDS[build]]))


def _room(compiled: Direct, *lead: int) -> dict[str, np.ndarray]:
    sizes = INFO.sizes
    real = compiled.package.options.real
    return {q.name: np.full((*lead, sizes.size(q)), 99.0, real) for q in FUNCTION.outputs}


def _compare(compiled: Direct, found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    limit = 1e-12 if compiled.package.options.real == "float64" else 1e-5
    for name, rows in expected.items():
        assert error(found[name].reshape(rows.shape), rows) < limit, name


@pytest.mark.parametrize("name", KERNELS)
def test_one_state_gives_every_output_or_says_which_entry_failed(compiled: Direct, name: str) -> None:
    real = compiled.package.options.real
    for bad in ((), (0,)):
        given = {k: v.astype(real) for k, v in given_at(KERNELS[name], 1, bad).items()}
        found = _room(compiled)
        status = compiled(name, *(v if k == "theta_b" else v[0] for k, v in given.items()), *found.values())
        assert status == (2 if bad else 0)
        _compare(compiled, found, all_expected(KERNELS[name], given, N, L, FRAMES))


@pytest.mark.parametrize("name", KERNELS)
@pytest.mark.parametrize("count", [1, 8, 9, 21])
@pytest.mark.parametrize("failing", [False, True])
def test_rows_hold_every_output_and_failed_rows_are_nan(
    compiled: Direct, name: str, count: int, failing: bool
) -> None:
    bad = (count - 1, count // 2) if failing else ()
    given = {
        k: v.astype(compiled.package.options.real) for k, v in given_at(KERNELS[name], count, bad).items()
    }
    found = _room(compiled, count + 1)
    status = compiled(f"{name}_batch", count, *given.values(), *found.values())
    assert status == (count // 2 + 1 if failing else 0)
    _compare(
        compiled,
        {k: v[:-1] for k, v in found.items()},
        all_expected(KERNELS[name], given, N, L, FRAMES),
    )
    assert all((rows[-1] == 99.0).all() for rows in found.values())


@pytest.mark.parametrize("failing", [False, True])
def test_lanes_hold_every_output_and_failed_lanes_are_nan(compiled: Direct, failing: bool) -> None:
    lanes = compiled.package.lanes
    count, bad = 2 * lanes, (lanes + 2,) if failing else ()
    kernel = KERNELS["everything"]
    given = {k: v.astype(compiled.package.options.real) for k, v in given_at(kernel, count, bad).items()}
    laid = [np.ascontiguousarray(v.reshape(2, lanes, -1).transpose(0, 2, 1)) for v in given.values()]
    found = {name: np.empty((2, rows.shape[-1], lanes), rows.dtype) for name, rows in _room(compiled).items()
             for rows in [rows[None]]}  # fmt: skip
    status = compiled("everything_batch_soa", count, *laid, *found.values())
    assert status == (bad[0] + 1 if failing else 0)
    rows = {name: v.transpose(0, 2, 1).reshape(count, -1) for name, v in found.items()}
    _compare(compiled, rows, all_expected(kernel, given, N, L, FRAMES))


@pytest.fixture(scope="module")
def robot() -> CompiledFunctions:
    return CompiledFunctions(interface_of(package()), library(package(), optimised=False))


def test_python_returns_a_named_tuple_of_shaped_arrays(robot: CompiledFunctions) -> None:
    given = given_at(KERNELS["everything"], 6)
    found = robot.call(FUNCTION, [given["q"].reshape(3, 2, N), given["load"][0].reshape(FRAMES, 6)])
    assert found._fields == ("energy", "slope", "turn", "M")
    assert [array.shape[2:] for array in found] == [(), (N,), (FRAMES, 3, 3), (N, N)]
    one = robot.call(FUNCTION, [given["q"][5], given["load"][0].reshape(FRAMES, 6)])
    np.testing.assert_array_equal(one.turn, found.turn[2, 1])
    assert one.energy == found.energy[2, 1]


def test_a_wrong_number_of_frames_names_the_frames(robot: CompiledFunctions) -> None:
    with pytest.raises(InputError, match=r"load has shape \(3, 6\), expected \(..., 2, 6\)") as caught:
        robot.call(FUNCTION, [np.zeros(N), np.zeros((3, 6))])
    assert "camera" in str(caught.value.hint)


def test_the_package_tests_every_output_itself_and_sees_a_wrong_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Self-test, C++ class and build files of the same signature."""
    monkeypatch.setenv("CC", str(wrapper(tmp_path)))
    given = given_at(KERNELS["everything"], 4)
    theta = np.array([1.5, -2.5])
    expected = {}
    for kernel in KERNELS.values():
        values = all_expected(kernel, given | {"theta_b": theta}, N, L, FRAMES)
        for output in FUNCTION.outputs:
            expected[FUNCTION.label(output, kernel.theta)] = values[output.name]
    states = ReferenceStates(given, expected, theta)
    write_package(tmp_path / "good", package_files(package(references=states)))
    build_package(tmp_path / "good")
    expected["everything_theta_turn"] = expected["everything_theta_turn"] + 1e-3
    write_package(
        tmp_path / "bad", package_files(package(references=ReferenceStates(given, expected, theta)))
    )
    with pytest.raises(Exception, match="everything_theta_turn"):
        build_package(tmp_path / "bad")


def test_header_and_class_say_what_there_is() -> None:
    files = package_files(package())
    header, cpp = files["include/odd/odd.h"], files["include/odd/odd.hpp"]
    assert "int odd_everything(const double *q, const double *load, double *energy, double *slope," in header
    assert "#define odd_FRAMES 2" in header
    assert "load is 2 x 6, row-major; energy is 1; slope is 3; turn is 2 x 3 x 3, row-major" in header
    assert "everything returns 0, or 1 + the joint that is odd" in header
    assert "must not overlap each other" in header
    assert r'"bo\"b"' in files["src/tables.c"]
    assert "const std::array<Real, 12> &load, std::array<Real, 1> &energy" in cpp


def test_a_name_that_c_takes_for_something_else_is_an_internal_error() -> None:
    function = replace(FUNCTION, outputs=(Quantity("V"),), factorises=())
    program = Tracer().finish([(Slot("V", 0), 1.0)])
    kernel = Kernel(function, False, program, program, "factored")
    with pytest.raises(InternalError, match="takes 'V' for something else"):
        package_view(INFO, {"everything": kernel}, EmitOptions())
