"""Converts a PROGRAM (list of operations to generate) to text and back, for tests and documents."""

from __future__ import annotations

import re

from psdmc.program.operations import BY_WORD
from psdmc.program.program import Instr, Op, Program, Slot

_SLOT = re.compile(r"([A-Za-z_]\w*)\[(\d+)\]")


def show(program: Program) -> str:
    """Return a PROGRAM (list of operations to generate) as text, with one instruction per line: 't2 = mul t0 t1', then
    'out tau[0] = t2'."""
    lines = [f"t{i} = {_right_side(instr)}" for i, instr in enumerate(program.body)]
    lines += [f"out {slot} = t{index}" for slot, index in program.outputs]
    return "\n".join(lines)


def _right_side(instr: Instr) -> str:
    if instr.op is Op.LOAD:
        return f"load {instr.slot}"
    if instr.op is Op.CONST:
        return f"const {instr.value!r}"
    return " ".join([instr.op.value, *(f"t{a}" for a in instr.args)])


def parse(text: str) -> Program:
    """Return the PROGRAM (list of operations to generate) that a text in the form of `show` describes. Names of values
    can be chosen freely. Raises ValueError that names a wrong line."""
    names: dict[str, int] = {}
    body: list[Instr] = []
    outputs: list[tuple[Slot, int]] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        words = raw.replace("=", " ").split()
        if not words:
            continue
        try:
            if words[0] == "out":
                outputs.append((_slot(words[1]), names[words[2]]))
            else:
                body.append(_instruction(words[1:], names))
                names[words[0]] = len(body) - 1
        except (KeyError, IndexError, ValueError) as error:
            raise ValueError(f"line {number}: cannot read {raw.strip()!r} ({error})") from error
    return Program(tuple(body), tuple(outputs))


def _instruction(words: list[str], names: dict[str, int]) -> Instr:
    op = BY_WORD[words[0]]
    if op is Op.LOAD:
        return Instr(op, slot=_slot(words[1]))
    if op is Op.CONST:
        return Instr(op, value=float(words[1]))
    args = tuple(names[word] for word in words[1:])
    if len(args) != op.arity:
        raise ValueError(f"{op.value} takes {op.arity} arguments")
    return Instr(op, args)


def _slot(word: str) -> Slot:
    match = _SLOT.fullmatch(word)
    if match is None:
        raise ValueError(f"{word!r} is no slot")
    return Slot(match[1], int(match[2]))
