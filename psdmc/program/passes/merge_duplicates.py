"""Compute equal things once."""

from __future__ import annotations

from psdmc.program.program import Instr, Program


def merge_duplicates(program: Program) -> Program:
    """Compute equal things once (value numbering).

    Needs:  every argument precedes its use.
    Keeps:  output values, bit for bit; output names and order.
    Gives:  no two instructions equal up to the order of commutative arguments.
    """
    first_seen: dict[Instr, int] = {}
    new_index: list[int] = []
    is_same = True
    for instr in program.body:
        key = instr.canonical(new_index)
        is_same = is_same and key is instr
        new_index.append(first_seen.setdefault(key, len(first_seen)))
    if is_same and len(first_seen) == len(program.body):
        return program
    outputs = tuple((slot, new_index[i]) for slot, i in program.outputs)
    return Program(tuple(first_seen), outputs)
