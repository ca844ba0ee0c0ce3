"""PROGRAMs at complex inputs, and their derivatives by complex steps: no difference is taken, no step is too small, and what
remains is the rounding of one evaluation (Squire and Trapp, SIAM Review 40, 1998)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from psdmc.program.program import Op, Program

STEP = 1e-100
"""Its square vanishes beside one and does not underflow."""

_FUNCTIONS: dict[Op, Callable[..., np.ndarray]] = {
    Op.ADD: np.add,
    Op.SUB: np.subtract,
    Op.MUL: np.multiply,
    Op.DIV: np.divide,
    Op.NEG: np.negative,
    Op.SIN: np.sin,
    Op.COS: np.cos,
    Op.SQRT: np.sqrt,
    Op.ABS: lambda a: np.where(a.real < 0, -a, a),
    Op.MIN: lambda a, b: np.where(a.real < b.real, a, b),
    Op.MAX: lambda a, b: np.where(a.real > b.real, a, b),
    Op.SELECT: lambda a, b, x, y: np.where(a.real < b.real, x, y),
    Op.EXP: np.exp,
    Op.TANH: np.tanh,
    Op.ATAN2: lambda y, x: np.arctan2(y.real, x.real) + 1j * _turn(y, x),
}


def _turn(y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """By how much the angle of (x, y) changes along the imaginary parts."""
    return (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)


def slopes_along(
    program: Program, point: Mapping[str, np.ndarray], ways: Mapping[str, np.ndarray], of: str, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """An output (k, size) at k points, and its slopes (k, size, d) along d ways.

    point   name -> (k, length)
    ways    name -> (k or 1, length, d): how each input changes along each way
    """
    given = {name: array[..., None] + 1j * STEP * ways.get(name, 0.0) for name, array in point.items()}
    values: list[np.ndarray] = []
    for instr in program.body:
        if instr.slot is not None:
            values.append(given[instr.slot.vector][:, instr.slot.index])
        elif instr.value is not None:
            values.append(np.complex128(instr.value))  # type: ignore[arg-type]
        else:
            values.append(_FUNCTIONS[instr.op](*(values[a] for a in instr.args)))
    count, d = len(next(iter(point.values()))), next(iter(ways.values())).shape[-1]
    out = np.zeros((count, size, d), dtype=complex)
    for slot, index in program.outputs:
        if slot.vector == of:
            out[:, slot.index] = values[index]
    return out[..., 0].real, out.imag / STEP
