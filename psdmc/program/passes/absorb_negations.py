"""Remove sign changes by changing neighbouring operations."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Instr, Op, Program


def absorb_negations(program: Program) -> Program:
    """Remove negations: the operation before or after a negation can often be changed so that the negation is not
    needed.

    The operation that uses a negated value becomes another one, as in x + -y = x - y, x - -y = x + y, -x * -y = x * y,
    -x / -y = x / y, --x = x, |-x| = |x|. If a result is used once, by a negation, the operation that computes the
    result is changed, as in -(x - y) = y - x, -(c x) = (-c) x, -((x - y) z) = (y - x) z.

    Needs:  every argument precedes its use.
    Keeps:  output values, bit for bit but for the sign of a zero; output names and order.
    Gives:  never more operations than before; every instruction is needed.
    """
    program = drop_unused(program)
    while any(instr.op is Op.NEG for instr in program.body):
        after = _absorbed_once(program)
        if after is program or after == program:  # each change leaves fewer uses of negations
            break
        program = after
    return program


def _absorbed_once(program: Program) -> Program:
    for absorb in (_into_uses, _into_producers):
        after = absorb(program)
        program = program if after is program else drop_unused(after)
    return program


def _into_uses(program: Program) -> Program:
    negations = {i for i, instr in enumerate(program.body) if instr.op is Op.NEG}
    users = [instr for instr in program.body if not negations.isdisjoint(instr.args)]
    if all(_absorbed(instr, program.body) is instr for instr in users):
        return program
    body: list[Instr] = []
    new_index: list[int] = []
    negations = set()
    for instr in program.body:
        moved = instr.renumbered(new_index)
        taken = moved if negations.isdisjoint(moved.args) else _absorbed(moved, body)
        if isinstance(taken, int):
            new_index.append(taken)
            continue
        if taken.op is Op.NEG:
            negations.add(len(body))
        new_index.append(len(body))
        body.append(taken)
    return Program(tuple(body), tuple((slot, new_index[i]) for slot, i in program.outputs))


def _absorbed(instr: Instr, body: Sequence[Instr]) -> Instr | int:
    """The instruction with the signs of its arguments absorbed, or the index of the value that it equals."""
    plain = [body[a].args[0] if body[a].op is Op.NEG else None for a in instr.args]
    match instr.op, plain:
        case Op.NEG, [int(x)]:
            return x
        case Op.ADD, [_, int(y)]:
            return Instr(Op.SUB, (instr.args[0], y))
        case Op.ADD, [int(x), None]:
            return Instr(Op.SUB, (instr.args[1], x))
        case Op.SUB, [_, int(y)]:
            return Instr(Op.ADD, (instr.args[0], y))
        case ((Op.MUL | Op.DIV), [int(x), int(y)]):
            return Instr(instr.op, (x, y))
        case _, [int(x)] if instr.op.operation.parity == "even":
            return Instr(instr.op, (x,))
    return instr


def _into_producers(program: Program) -> Program:
    body, uses = list(program.body), program.uses()
    new_index = list(range(len(body)))
    taken = 0
    for i, instr in enumerate(program.body):
        if instr.op is Op.NEG and _negate(body, uses, instr.args[0]):
            new_index[i] = instr.args[0]
            taken += 1
    if not taken:
        return program
    moved = tuple(instr.renumbered(new_index) for instr in body)
    return Program(moved, tuple((slot, new_index[i]) for slot, i in program.outputs))


def _negate(body: list[Instr], uses: Sequence[int], index: int) -> bool:
    """Change a value's sign in place if that costs nothing and no other instruction uses it; say if so."""
    instr = body[index]
    if uses[index] != 1:
        return False
    if instr.op is Op.SUB:
        body[index] = Instr(Op.SUB, instr.args[::-1])
        return True
    if instr.op is Op.CONST and instr.value is not None:
        body[index] = Instr(Op.CONST, value=-instr.value)
        return True
    return instr.op in (Op.MUL, Op.DIV) and any(_negate(body, uses, a) for a in instr.args)
