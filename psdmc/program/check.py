"""The rules that every PROGRAM obeys; the pipeline checks them between passes."""

from __future__ import annotations

import math

from psdmc.errors import InternalError
from psdmc.program.program import Instr, Op, Program

_WITH_TWO = frozenset(op for op in Op if op.arity == 2)


def check(program: Program, after: str = "tracing") -> Program:
    """The same program; InternalError where a rule is broken, naming the pass that broke it."""
    arguments, users = program.arguments()
    suspects = set(users[(arguments < 0) | (arguments >= users)].tolist())
    suspects.update(
        i
        for i, (op, args, slot, value) in enumerate(program.body)
        if len(args) != 2 or slot is not None or value is not None or op not in _WITH_TWO
    )
    for i in sorted(suspects):
        if not _is_sound(i, program.body[i]):
            raise InternalError(f"after {after}: {_fault(i, program.body[i])}")
    slots = [slot for slot, _ in program.outputs]
    if len(set(slots)) != len(slots):
        raise InternalError(f"after {after}: an output is stored twice")
    if any(not 0 <= index < len(program.body) for _, index in program.outputs):
        raise InternalError(f"after {after}: an output is not defined")
    return program


def _is_sound(i: int, instr: Instr) -> bool:
    """Whether instruction i obeys the rules."""
    op, args, slot, value = instr
    if op is Op.LOAD:
        return slot is not None and value is None and not args
    if op is Op.CONST:
        return value is not None and math.isfinite(value) and slot is None and not args
    if slot is not None or value is not None:
        return False
    return len(args) == op.arity and all(0 <= a < i for a in args)


def _fault(i: int, instr: Instr) -> str:
    """The rule that instruction i breaks, as text."""
    op, args, slot, value = instr
    if len(args) != op.arity:
        return f"t{i} = {op.value} has {len(args)} arguments"
    if args and (min(args) < 0 or max(args) >= i):
        return f"t{i} uses a value that is not defined before it"
    if (op is Op.LOAD) != (slot is not None):
        return f"t{i}: loads, and only loads, have a slot"
    if (op is Op.CONST) != (value is not None):
        return f"t{i}: constants, and only constants, have a value"
    return f"t{i} is the constant {value}"
