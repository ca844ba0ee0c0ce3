"""A pass of the code generator: it computes those operations at compile time that do not depend on the inputs."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.program.program import Instr, Op, Program


def fold_constants(program: Program) -> Program:
    """Return the PROGRAM (list of operations to generate) with operations on constants replaced by their results. Sums
    with 0 and products with 0 and 1 are dropped.

    Needs:  every argument precedes its use; finite inputs (0 * x is taken for 0).
    Keeps:  output values, bit for bit but for the sign of a zero; output names and order.
    Gives:  no operation has only constants as arguments, except if its result is not finite; unused instructions stay.
    """
    constants = {i for i, instr in enumerate(program.body) if instr.value is not None}
    if not any(_folds(instr, program.body) for instr in program.body if not constants.isdisjoint(instr.args)):
        return program
    body: list[Instr] = []
    new_index: list[int] = []
    constants = set()
    for instr in program.body:
        moved = instr.renumbered(new_index)
        known = None
        if not constants.isdisjoint(moved.args):
            known = _argument_that_it_equals(moved, body)
            moved = _folded(moved, body)
        if known is None:
            known = len(body)
            body.append(moved)
            if moved.value is not None:
                constants.add(known)
        new_index.append(known)
    return Program(tuple(body), tuple((slot, new_index[i]) for slot, i in program.outputs))


def _folds(instr: Instr, body: Sequence[Instr]) -> bool:
    """Whether there is something to do for an instruction as it stands: without a first there is no other."""
    return _folded(instr, body) is not instr or _argument_that_it_equals(instr, body) is not None


def _folded(instr: Instr, body: Sequence[Instr]) -> Instr:
    values = [value for a in instr.args if (value := body[a].value) is not None]
    if not values or len(values) < len(instr.args):
        return instr
    folded = instr.op.of_numbers(values)
    return instr if folded is None else Instr(Op.CONST, value=folded)


def _argument_that_it_equals(instr: Instr, body: Sequence[Instr]) -> int | None:
    """Index of the value that x + 0, x - 0, x * 1, x / 1 or x * 0 is; None for all else."""
    if len(instr.args) != 2:
        return None
    left, right = instr.args
    for this, other in ((left, right), (right, left)):
        value = body[this].value
        if instr.op is Op.MUL and value == 0.0:
            return this
        if (instr.op is Op.ADD and value == 0.0) or (instr.op is Op.MUL and value == 1.0):
            return other
    is_neutral = (instr.op is Op.SUB and body[right].value == 0.0) or (
        instr.op is Op.DIV and body[right].value == 1.0
    )
    return left if is_neutral else None
