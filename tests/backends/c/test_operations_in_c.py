"""Every operation in C: one state, rows and lanes, against mpmath within the stated units in the last place."""

from __future__ import annotations

import math
from pathlib import Path

import mpmath
import numpy as np
import pytest
from direct import Direct, shared_library
from fifty_digits import MP
from operation_arguments import arguments
from slow_cases import slow_but_for
from small import pendulum, pendulum_info

from psdmc.backends.c.back_end import library_files
from psdmc.backends.c.expressions import CALLS, is_call
from psdmc.backends.c.package import PackageView, package_view
from psdmc.backends.info import EmitOptions
from psdmc.errors import InputError
from psdmc.program.interpret import interpret
from psdmc.program.kernel import Kernel
from psdmc.program.limb_program import LimbGroup, LimbProgram, Stage, unpacked
from psdmc.program.operations import Unit
from psdmc.program.program import Instr, Op, Program, Slot
from psdmc.program.signature import Quantity, Signature
from psdmc.program.text import parse

CALLED = [op for op in Op if op.arity and op.unit is not Unit.SINCOS]
FUNCTION = Signature(
    "trial",
    1,
    "each operation once",
    (Quantity("x", ("4",)),),
    (Quantity("y", (str(len(CALLED)),)),),
    theta=False,
)


def package(options: EmitOptions) -> PackageView:
    """A function that stores each operation of the first arguments."""
    loads = tuple(Instr(Op.LOAD, slot=Slot("x", k)) for k in range(4))
    body = (*loads, *(Instr(op, tuple(range(op.arity))) for op in CALLED))
    program = Program(body, tuple((Slot("y", k), 4 + k) for k in range(len(CALLED))))
    kernel = Kernel(FUNCTION, False, program, program, "factored")
    return package_view(pendulum_info(), {"trial": kernel}, options)


def test_every_operation_without_an_operator_has_its_c() -> None:
    assert set(CALLS) == {op for op in Op if is_call(op)}


FLAGS = ("-march=native", "-g0", "-Dpendulum_NO_VECTORS")
CASES = [(real, flag) for real in ("float64", "float32") for flag in FLAGS]


@pytest.mark.parametrize(("real", "flag"), slow_but_for([CASES[0], CASES[4]], CASES, spread=True))
def test_c_is_as_accurate_as_it_says_in_all_forms(real: str, flag: str, tmp_path: Path) -> None:
    made = package(EmitOptions(real=real))  # type: ignore[arg-type]
    flags = ["-O2", "-Wall", "-Wextra", "-Werror", "-fno-math-errno", "-fno-trapping-math", flag]
    call = Direct(made, shared_library(made, tmp_path, flags))
    for op in CALLED:
        x = arguments(op, 4, real)
        count, width, lanes = len(x), len(CALLED), made.lanes
        rows = np.zeros((count, width), real)
        call("trial_batch", count, x, rows)
        blocks = -(-count // lanes)
        padded = np.vstack([x, np.ones((blocks * lanes - count, 4), real)])
        laid = np.ascontiguousarray(padded.reshape(blocks, lanes, 4).transpose(0, 2, 1).reshape(-1))
        by_lane = np.zeros(blocks * lanes * width, real)
        call("trial_batch_soa", count, laid, by_lane)
        back = by_lane.reshape(blocks, width, lanes).transpose(0, 2, 1).reshape(-1, width)[:count]
        single = np.zeros((count, width), real)
        for k in range(count):
            call("trial", x[k], single[k])
        place = CALLED.index(op)
        for found in (single, rows, back):
            check_each(op, x, found[:, place])


def check_each(op: Op, x: np.ndarray, found: np.ndarray) -> None:
    """Within the stated units in the last place; infinite, NaN and of the sign of zero where NumPy is."""
    with np.errstate(all="ignore"):
        wanted = op(*(x[:, k].astype(float) for k in range(op.arity)))
        nearest = wanted.astype(found.dtype)
    for row, value, meant in zip(x.astype(float), found.astype(float), nearest.astype(float), strict=True):
        given = row[: op.arity]
        if not np.all(np.isfinite(given)) or not math.isfinite(meant) or np.any(given == 0.0):
            np.testing.assert_equal(value, meant, err_msg=f"{op} of {given}")
            continue
        with mpmath.workdps(60):
            exact = MP[op](*map(mpmath.mpf, given))
            step = mpmath.mpf(float(np.spacing(found.dtype.type(abs(float(exact))))))
            error = abs(mpmath.mpf(value) - exact) / step
        assert error <= op.operation.ulp, f"{op} of {given}: {value}, {float(error)} ulp"


def test_a_freestanding_package_refuses_the_functions_of_libm() -> None:
    with pytest.raises(InputError, match="pendulum: trial needs exp, which is libm's"):
        package(EmitOptions(trig="freestanding"))


LIMB = """
    x = load group0_x[0]
    half = const 0.5
    magnitude = abs x
    s = sqrt magnitude
    t = tanh x
    e = exp t
    a = atan2 s t
    low = min e a
    high = max low half
    y = select t half high low
    out group0_output[0] = y
"""


def test_limbs_have_them_in_lanes(tmp_path: Path) -> None:
    """Four limbs, and three in a vector of four."""
    for count in (4, 3):
        own = [tuple(Slot(vector, k) for k in range(count)) for vector in "xy"]
        group = LimbGroup(
            0, count, ((Slot("group0_x", 0), own[0]),), (), ((Slot("group0_output", 0), own[1]),)
        )
        limbs = LimbProgram((group,), (Stage(0, parse(LIMB)),))
        whole = unpacked(limbs)
        vectors = [Quantity(name, (str(count),)) for name in "xy"]
        function = Signature("trial", 1, "limbs", (vectors[0],), (vectors[1],), theta=False)
        kernel = Kernel(function, False, whole, whole, "factored", limbs=limbs)
        made = package_view(pendulum_info(), {"trial": kernel}, EmitOptions())
        folder = tmp_path / str(count)
        call = Direct(made, shared_library(made, folder, ["-O1", "-Wall", "-Werror", "-march=x86-64-v3"]))
        x, y = np.array([0.3, -1.2, 4.0, -0.01][:count]), np.zeros(count)
        call("trial", x, y)
        np.testing.assert_allclose(y, interpret(whole, {"x": x}, {"y": count})["y"], rtol=4e-16)
        assert "tanh_limbs" in (folder / f"src/limbs{count}.h").read_text()


def test_packages_without_them_have_no_file_of_them() -> None:
    assert "src/operations.h" in library_files(package(EmitOptions()))
    assert "src/operations.h" not in library_files(pendulum())
