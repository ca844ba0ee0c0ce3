"""Run a PROGRAM (list of operations) on arrays of states, or on symbols.

On symbols, the operations are recorded in another trace. There, the values can be used further, or the inputs replaced.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.errors import InternalError
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Constant, Symbol, Tracer

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


Value = Symbol | Constant


def replayed(program: Program, tracer: Tracer, given: Mapping[Slot, Value]) -> list[Value]:
    """Return the values of all outputs of a PROGRAM (list of operations), recorded in another trace, in the PROGRAM's
    order. `given` are the values of inputs. Inputs without a value stay inputs."""

    def load(slot: Slot) -> Value:
        found = given.get(slot)
        return tracer.symbol(slot) if found is None else found

    return [value for _, value in evaluated(program, load)]


def substituted(values: Sequence[Value], inputs: Sequence[Symbol], given: Sequence[Value]) -> list[Value]:
    """Return recorded values computed anew, with `given` in place of the inputs `inputs`. In a sum over limbs (equal
    branches such as legs), the summed value is computed anew, too."""
    tracer = inputs[0].tracer
    if any(symbol.slot is None for symbol in inputs):
        raise InternalError("only inputs can be replaced")
    known = dict(zip((symbol.index for symbol in inputs), given, strict=True))
    changed = {index: value for index, value in known.items() if not _is_value(value, index)}
    roots = [value.index for value in values if isinstance(value, Symbol)]
    for index, is_needed in enumerate(tracer.needed(roots, known)):
        if is_needed and index not in known:
            arguments = tracer.arguments(index)
            if not changed.keys().isdisjoint(arguments):
                value = _replaced(tracer, index, arguments, changed)
                if not _is_value(value, index):
                    changed[index] = value
    found: list[Value] = []
    for value in values:
        if isinstance(value, Symbol) and value.index in changed:
            own = changed[value.index]
            found.append(-own if value.negative else own)
        else:
            found.append(value)
    return found


def _is_value(value: Value, index: int) -> bool:
    """Whether this is the recorded value of that index, without a sign."""
    return isinstance(value, Symbol) and value.index == index and not value.negative


def _replaced(tracer: Tracer, index: int, arguments: tuple[int, ...], changed: Mapping[int, Value]) -> Value:
    """A value from what its arguments have become."""
    own = [changed[each] if each in changed else Symbol(tracer, each) for each in arguments]
    sums = tracer.limb_sums
    if sums is not None and index in sums.summed:
        return sums.total(sums.group_of(arguments[0]), own[0])
    op = tracer.steps[index][0]
    value: Value = op.numbers(*own) if op.written else op(*own)
    return value
