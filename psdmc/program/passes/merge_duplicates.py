"""Compute equal things once."""

from __future__ import annotations

from operator import is_

from psdmc.program.program import Instr, Program


def merge_duplicates(program: Program) -> Program:
    """Return the PROGRAM (list of operations to generate) with equal operations computed only once.

    Needs:  every argument precedes its use.
    Keeps:  output values, bit for bit; the names and the order of outputs.
    Gives:  no two instructions equal up to the order of commutative arguments.
    """
    first_seen: dict[Instr, int] = {}
    new_index: list[int] = []
    for instr in program.body:
        new_index.append(first_seen.setdefault(instr.canonical(new_index), len(first_seen)))
    body = tuple(first_seen)
    if len(body) == len(program.body) and all(map(is_, body, program.body)):
        return program
    outputs = tuple((slot, new_index[i]) for slot, i in program.outputs)
    return Program(body, outputs)
