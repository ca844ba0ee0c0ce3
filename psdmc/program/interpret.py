"""Run a PROGRAM on arrays of states."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.program.program import Program, Slot

Array = NDArray[np.float64]


def interpret(program: Program, inputs: Mapping[str, Array], sizes: Mapping[str, int]) -> dict[str, Array]:
    """Execute a PROGRAM (list of operations) on arrays, one state or many at once. Return each output vector by name,
    (..., size).

    inputs  input vectors by name, (..., length); leading axes broadcast
    sizes   length of each output vector; entries that the PROGRAM does not store are zero
    """
    given = {name: np.asarray(array, dtype=np.float64) for name, array in inputs.items()}
    shape = np.broadcast_shapes(*(array.shape[:-1] for array in given.values())) if given else ()

    def load(slot: Slot) -> Array:
        return given[slot.vector][..., slot.index]

    out = {name: np.zeros((*shape, size)) for name, size in sizes.items()}
    for slot, value in evaluated(program, load, np.float64):
        out[slot.vector][..., slot.index] = value
    return out


def evaluated(
    program: Program, load: Callable[[Slot], Any], constant: Callable[[float], Any] = float
) -> list[tuple[Slot, Any]]:
    """Return each output entry of a PROGRAM with its value. The values are computed on any scalars: numbers, arrays or
    symbols.

    load      function that returns the value of an input entry
    constant  function that converts a constant of the PROGRAM to a scalar
    """
    values: list[Any] = []
    for op, args, slot, value in program.body:
        if args:
            given = [values[a] for a in args]
            values.append(op.numbers(*given) if op.written else op(*given))
        elif slot is not None:
            values.append(load(slot))
        elif value is not None:
            values.append(constant(value))
    return [(slot, values[index]) for slot, index in program.outputs]
