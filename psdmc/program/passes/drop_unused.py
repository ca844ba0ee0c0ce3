"""Drop instructions that no output needs."""

from __future__ import annotations

from psdmc.program.program import Instr, Program


def drop_unused(program: Program) -> Program:
    """Return the PROGRAM (list of operations to generate) with only those instructions on which some output depends.

    Needs:  every argument precedes its use.
    Keeps:  output values, bit for bit; the order of the remaining instructions.
    Gives:  every instruction is an output or an argument.
    """
    if all(program.uses()):  # by what lies behind, and the last one by an output
        return program
    needed = [False] * len(program.body)
    for _, index in program.outputs:
        needed[index] = True
    for i in reversed(range(len(program.body))):
        if needed[i]:
            for a in program.body[i].args:
                needed[a] = True
    new_index = [0] * len(program.body)
    body: list[Instr] = []
    for i, instr in enumerate(program.body):
        if needed[i]:
            new_index[i] = len(body)
            body.append(instr.renumbered(new_index))
    return Program(tuple(body), tuple((slot, new_index[i]) for slot, i in program.outputs))
