"""A PROGRAM recorded again on symbols, to compute with its values or to give it other inputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psdmc.errors import InternalError
from psdmc.program.interpret import evaluated
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Constant, Symbol, Tracer

Value = Symbol | Constant


def replayed(program: Program, tracer: Tracer, given: Mapping[Slot, Value]) -> list[Value]:
    """The PROGRAM's outputs, in its order, with these values for its inputs. Inputs that are not given stay inputs."""

    def load(slot: Slot) -> Value:
        found = given.get(slot)
        return tracer.symbol(slot) if found is None else found

    return [value for _, value in evaluated(program, load)]


def substituted(values: Sequence[Value], inputs: Sequence[Symbol], given: Sequence[Value]) -> list[Value]:
    """Recorded values, with other values in place of some of the inputs that they are computed from."""
    tracer = inputs[0].tracer
    slots = [slot for symbol in inputs if (slot := symbol.slot) is not None]
    if len(slots) < len(inputs):
        raise InternalError("only inputs can be replaced")
    program = tracer.finish([(Slot("value", i), value) for i, value in enumerate(values)])
    return replayed(program, tracer, dict(zip(slots, given, strict=True)))
