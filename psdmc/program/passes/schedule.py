"""A pass of the code generator: it orders the instructions of a PROGRAM (list of operations to generate). In the new
order, few values are alive (computed and still needed) at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.program.program import Program


def schedule(program: Program) -> Program:
    """Return the PROGRAM (list of operations to generate) in an order in which each value is computed shortly before
    its first use.

    Outputs are computed one after the other, in their order. If an operation has two arguments, the argument that keeps
    more values alive is computed first (Sethi and Ullman 1970, exact for trees). The given order is kept if the new one
    would hold more values alive over the whole PROGRAM.

    Needs:  every argument precedes its use; every instruction is needed.
    Keeps:  output values, bit for bit; output names and order; the set of instructions.
    Gives:  a sum of live values over all instructions that is no larger than before.
    """
    order = _depth_first(program)
    return reordered(program, order) if live_values(program, order) < live_values(program) else program


def live_values(program: Program, order: Sequence[int] | None = None) -> int:
    """Return the number of values that are still needed after an instruction, summed over all instructions. Inputs and
    constants do not count. `order` is another order of the instructions that are needed; None: the PROGRAM's own."""
    arguments, users = program.arguments()
    here = np.arange(len(program.body) if order is None else len(order))
    if order is not None:
        place = np.full(len(program.body), -1)
        place[list(order)] = here
        arguments, users = place[arguments], place[users]
        ascending = np.argsort(users, kind="stable")[np.count_nonzero(users < 0) :]
        arguments, users = arguments[ascending], users[ascending]
    last = here.copy()
    last[arguments] = users  # ascending: the last one stays
    computed = np.zeros(len(here), bool)
    computed[users] = True
    return int((last - here)[computed].sum())


def beyond_registers(program: Program, registers: int) -> int:
    """Return the number of needed values that do not fit in the processor's registers, summed over all instructions.
    Inputs and constants do not count."""
    ends = [0] * (len(program.body) + 1)
    last = list(range(len(program.body)))
    for i, (_, args, _, _) in enumerate(program.body):
        for a in args:
            last[a] = i
    alive = total = 0
    for i, (_, args, _, _) in enumerate(program.body):
        if args and last[i] > i:
            alive += 1
            ends[last[i]] += 1
        alive -= ends[i]
        total += max(alive - registers, 0)
    return total


def _need(program: Program) -> list[int]:
    """Values alive at once while one value is computed, if nothing were shared."""
    need: list[int] = []
    for _, args, _, _ in program.body:
        if len(args) == 2:
            first, second = need[args[0]], need[args[1]]
            need.append(first + 1 if first == second else first if first > second else second)
        elif not args:
            need.append(0)
        else:
            most = sorted([need[a] for a in args], reverse=True)
            need.append(max([1, *(own + held for held, own in enumerate(most))]))
    return need


def _depth_first(program: Program) -> list[int]:
    """Values in the order in which they are computed. On the stack ~index stands for a value whose arguments are placed."""
    need = _need(program)
    arguments = [args for _, args, _, _ in program.body]
    placed = [False] * len(arguments)
    order: list[int] = []
    stack = [root for _, root in reversed(program.outputs)]
    while stack:
        index = stack.pop()
        is_ready = index < 0
        index = ~index if is_ready else index
        if placed[index]:
            continue
        args = arguments[index]
        if is_ready or not args:
            placed[index] = True
            order.append(index)
            continue
        stack.append(~index)
        if len(args) != 2:
            stack.extend([a for a in args if not placed[a]])
            continue
        first, second = args
        if need[first] > need[second] or (need[first] == need[second] and first < second):
            first, second = second, first
        if not placed[first]:
            stack.append(first)
        if not placed[second]:
            stack.append(second)
    return order


def reordered(program: Program, order: list[int]) -> Program:
    """Return the PROGRAM (list of operations to generate) with its instructions in the given order.

    The order lists the present numbers of the instructions. Every argument must precede its use in this order.
    """
    new_index = [0] * len(program.body)
    for new, old in enumerate(order):
        new_index[old] = new
    body = tuple(program.body[old].renumbered(new_index) for old in order)
    return Program(body, tuple((slot, new_index[i]) for slot, i in program.outputs))
