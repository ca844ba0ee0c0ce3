"""PROGRAMs at fifty digits, and their derivatives as central differences: exact to some thirty."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import mpmath
import numpy as np

from psdmc.program.program import Op, Program

DIGITS = 50
STEP = 16
"""Minus the decimal exponent of the step: its square is what a difference misses by."""

MP: dict[Op, Callable[..., mpmath.mpf]] = {
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.DIV: lambda a, b: a / b,
    Op.NEG: lambda a: -a,
    Op.SIN: mpmath.sin,
    Op.COS: mpmath.cos,
    Op.SQRT: mpmath.sqrt,
    Op.ABS: abs,
    Op.MIN: min,
    Op.MAX: max,
    Op.SELECT: lambda a, b, x, y: x if a < b else y,
    Op.EXP: mpmath.exp,
    Op.TANH: mpmath.tanh,
    Op.LOG: mpmath.log,
    Op.POW: mpmath.power,
    Op.ATAN2: mpmath.atan2,
}
"""Every operation, by mpmath."""


def values(program: Program, point: Mapping[str, list[mpmath.mpf]], of: str, size: int) -> list[mpmath.mpf]:
    """One output vector at a point, with mpmath's digits."""
    found: list[mpmath.mpf] = []
    for instr in program.body:
        if instr.slot is not None:
            found.append(point[instr.slot.vector][instr.slot.index])
        elif instr.value is not None:
            found.append(mpmath.mpf(instr.value))
        else:
            found.append(MP[instr.op](*(found[a] for a in instr.args)))
    out = [mpmath.mpf(0)] * size
    for slot, index in program.outputs:
        if slot.vector == of:
            out[slot.index] = found[index]
    return out


def fifty_digit_jacobian(
    program: Program, point: Mapping[str, np.ndarray], of: str, size: int, by: str
) -> np.ndarray:
    """(size, length of `by`): entry [i, j] = d of[i] / d by[j] at a point."""
    with mpmath.workdps(DIGITS):
        step = mpmath.mpf(10) ** -STEP
        columns = []
        for j in range(len(point[by])):
            sides = []
            for sign in (1, -1):
                there = {name: [mpmath.mpf(float(x)) for x in vector] for name, vector in point.items()}
                there[by][j] += sign * step
                sides.append(values(program, there, of, size))
            columns.append([float((a - b) / (2 * step)) for a, b in zip(*sides, strict=True)])
    return np.array(columns).T
