"""A PROGRAM evaluated on abstract scalars: floats, arrays of states, or symbols of another PROGRAM."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from psdmc.friction import scalars
from psdmc.program.program import Program, Slot

_MEANING: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "sin": scalars.sin,
    "cos": scalars.cos,
    "sqrt": scalars.sqrt,
    "abs": scalars.absolute,
    "min": scalars.smaller,
    "max": scalars.larger,
    "select": scalars.select,
    "exp": scalars.exp,
    "tanh": scalars.tanh,
    "pow": scalars.power,
}


def evaluated(program: Program, given: Callable[[Slot], Any]) -> list[Any]:
    """The outputs in the PROGRAM's order, of inputs by slot."""
    values: list[Any] = []
    for instr in program:
        if instr.slot is not None:
            values.append(given(instr.slot))
        elif instr.value is not None:
            values.append(instr.value)
        else:
            values.append(_MEANING[instr.op.value](*(values[a] for a in instr.args)))
    return [values[index] for _, index in program.outputs]
