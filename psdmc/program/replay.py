"""Executes a PROGRAM (list of operations) on symbols, which records the operations in another trace. There, the values
can be used further, or the inputs replaced."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from psdmc.errors import InternalError
from psdmc.program.interpret import evaluated
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Constant, Symbol, Tracer

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
    found = dict(zip((symbol.index for symbol in inputs), given, strict=True))
    roots = [value.index for value in values if isinstance(value, Symbol)]
    for index in _computed_from(tracer, roots, found):
        found[index] = _replaced(tracer, index, found)
    return [_signed(found[value.index], value) if isinstance(value, Symbol) else value for value in values]


def _computed_from(tracer: Tracer, roots: Sequence[int], known: Mapping[int, Value]) -> Iterator[int]:
    """What the roots are computed from, and they themselves, in their order; nothing that is known already."""
    needed = [False] * (max(roots, default=-1) + 1)
    for root in roots:
        needed[root] = True
    for index in reversed(range(len(needed))):
        if needed[index] and index not in known:
            for argument in tracer.arguments(index):
                needed[argument] = True
    return (index for index, is_needed in enumerate(needed) if is_needed and index not in known)


def _replaced(tracer: Tracer, index: int, found: Mapping[int, Value]) -> Value:
    """A value from what its arguments have become; itself where none has changed."""
    arguments = tracer.arguments(index)
    own = [found[argument] for argument in arguments]
    if all(
        isinstance(value, Symbol) and value.index == argument and not value.negative
        for value, argument in zip(own, arguments, strict=True)
    ):
        return Symbol(tracer, index)
    sums = tracer.limb_sums
    if sums is not None and index in sums.summed:
        return sums.total(sums.group_of(arguments[0]), own[0])
    op = tracer.steps[index][0]
    value: Value = op.numbers(*own) if op.written else op(*own)
    return value


def _signed(value: Value, symbol: Symbol) -> Value:
    return -value if symbol.negative else value
