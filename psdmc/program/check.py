"""The rules that every PROGRAM (list of operations) obeys. They are checked after each pass, that is, after each change
of a whole PROGRAM."""

from __future__ import annotations

import math

from psdmc.errors import InternalError
from psdmc.program.program import Instr, Op, Program

_WITH_TWO = frozenset(op for op in Op if op.arity == 2)


def check(program: Program, after: str = "tracing") -> Program:
    """Return the given PROGRAM (list of operations) unchanged. Raises InternalError if the PROGRAM breaks a rule; the
    message names `after`, the step that changed it last."""
    for i, instr in enumerate(program.body):
        op, args, slot, value = instr
        if len(args) == 2 and op in _WITH_TWO and slot is None and value is None:
            a, b = args
            if 0 <= a < i and 0 <= b < i:
                continue  # as nearly all: the same as _is_sound says
        if not _is_sound(i, instr):
            raise InternalError(f"after {after}: {_fault(i, instr)}")
    slots = [slot for slot, _ in program.outputs]
    if len(set(slots)) != len(slots):
        raise InternalError(f"after {after}: an output is stored twice")
    if any(not 0 <= index < len(program.body) for _, index in program.outputs):
        raise InternalError(f"after {after}: an output is not defined")
    return program


def _is_sound(i: int, instr: Instr) -> bool:
    """Whether instruction i obeys the rules. Fast, as it is called for every instruction after every pass."""
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
