"""A PROGRAM recorded again on symbols, to compute with its values or to give it other inputs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from psdmc.errors import InternalError
from psdmc.program.program import Instr, Op, Program, Slot
from psdmc.program.trace import Number, Symbol, Tracer
from psdmc.reproducible import cosine, sine

Value = Symbol | Number


def replayed(program: Program, tracer: Tracer, given: Mapping[Slot, Value]) -> list[Value]:
    """The PROGRAM's outputs, in its order, with these values for its inputs. Inputs that are not given stay inputs."""
    values: list[Value] = []
    for instr in program.body:
        if instr.slot is not None:
            found = given.get(instr.slot)
            values.append(tracer.symbol(instr.slot) if found is None else found)
        else:
            values.append(_value(instr, values))
    return [values[index] for _, index in program.outputs]


def substituted(values: Sequence[Value], inputs: Sequence[Symbol], given: Sequence[Value]) -> list[Value]:
    """Recorded values, with other values in place of some of the inputs that they are computed from."""
    tracer = inputs[0].tracer
    slots = [slot for symbol in inputs if (slot := symbol.slot) is not None]
    if len(slots) < len(inputs):
        raise InternalError("only inputs can be replaced")
    program = tracer.finish([(Slot("value", i), value) for i, value in enumerate(values)])
    return replayed(program, tracer, dict(zip(slots, given, strict=True)))


def _value(instr: Instr, values: Sequence[Value]) -> Value:
    if instr.value is not None:
        return instr.value
    a = values[instr.args[0]]
    if instr.op in (Op.SIN, Op.COS):
        return _sincos(a)[0 if instr.op is Op.SIN else 1]
    if instr.op is Op.NEG:
        return -a
    if instr.op is Op.SQRT:
        return a.root() if isinstance(a, Symbol) else math.sqrt(a)
    b = values[instr.args[1]]
    if instr.op is Op.ADD:
        return a + b
    if instr.op is Op.SUB:
        return a - b
    return a * b if instr.op is Op.MUL else a / b


def _sincos(angle: Value) -> tuple[Value, Value]:
    return angle.sincos() if isinstance(angle, Symbol) else (float(sine(angle)), float(cosine(angle)))
