"""Run a PROGRAM on arrays of states."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from psdmc.program.program import Program

Array = NDArray[np.float64]


def interpret(program: Program, inputs: Mapping[str, Array], sizes: Mapping[str, int]) -> dict[str, Array]:
    """Outputs by vector name, (..., size), from inputs by vector name, (..., length); leading axes broadcast.

    `sizes` gives the length of each output vector; entries that the program does not store are zero.
    """
    given = {name: np.asarray(array, dtype=np.float64) for name, array in inputs.items()}
    shape = np.broadcast_shapes(*(array.shape[:-1] for array in given.values())) if given else ()
    values: list[Array] = []
    for instr in program.body:
        if instr.slot is not None:
            values.append(given[instr.slot.vector][..., instr.slot.index])
        elif instr.value is not None:
            values.append(np.float64(instr.value))  # type: ignore[arg-type]
        else:
            values.append(instr.op(*(values[a] for a in instr.args)))
    out = {name: np.zeros((*shape, size)) for name, size in sizes.items()}
    for slot, index in program.outputs:
        out[slot.vector][..., slot.index] = values[index]
    return out
