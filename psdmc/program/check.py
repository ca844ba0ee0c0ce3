"""The rules that every PROGRAM obeys; the pipeline checks them between passes."""

from __future__ import annotations

import math

from psdmc.errors import InternalError
from psdmc.program.program import ARITY, Op, Program


def check(program: Program, after: str = "tracing") -> Program:
    """The same program; InternalError where a rule is broken, naming the pass that broke it."""
    for i, (op, args, slot, value) in enumerate(program.body):
        if len(args) != ARITY[op]:
            raise InternalError(f"after {after}: t{i} = {op.value} has {len(args)} arguments")
        if args and (min(args) < 0 or max(args) >= i):
            raise InternalError(f"after {after}: t{i} uses a value that is not defined before it")
        if (op is Op.LOAD) != (slot is not None):
            raise InternalError(f"after {after}: t{i}: loads, and only loads, have a slot")
        if (op is Op.CONST) != (value is not None):
            raise InternalError(f"after {after}: t{i}: constants, and only constants, have a value")
        if value is not None and not math.isfinite(value):
            raise InternalError(f"after {after}: t{i} is the constant {value}")
    slots = [slot for slot, _ in program.outputs]
    if len(set(slots)) != len(slots):
        raise InternalError(f"after {after}: an output is stored twice")
    if any(not 0 <= index < len(program.body) for _, index in program.outputs):
        raise InternalError(f"after {after}: an output is not defined")
    return program
