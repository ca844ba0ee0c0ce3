"""Put instructions in an order that keeps few values alive at a time."""

from __future__ import annotations

from psdmc.program.program import Program


def schedule(program: Program) -> Program:
    """Compute each value shortly before its first use.

    Outputs are taken one after the other, in their order; of an operation's arguments the one is computed
    first that needs more values alive itself (Sethi and Ullman 1970, exact for trees). The order given is
    kept where this one would hold more values alive over the whole PROGRAM.

    Needs:  every argument precedes its use; every instruction is needed.
    Keeps:  output values, bit for bit; output names and order; the set of instructions.
    Gives:  a sum of live values over all instructions that is no larger than before.
    """
    order = _depth_first(program)
    candidate = _reordered(program, order)
    return candidate if live_values(candidate) < live_values(program) else program


def live_values(program: Program) -> int:
    """Sum over all instructions of the values alive behind it; loads and constants do not count."""
    last = list(range(len(program.body)))
    for i, instr in enumerate(program.body):
        for a in instr.args:
            last[a] = i
    return sum(last[i] - i for i, instr in enumerate(program.body) if instr.args)


def _need(program: Program) -> list[int]:
    """Values alive at once while one value is computed, if nothing were shared."""
    need: list[int] = []
    for instr in program.body:
        wanted = sorted((need[a] for a in instr.args), reverse=True)
        need.append(max((n + i for i, n in enumerate(wanted)), default=0) if wanted else 0)
        if instr.args:
            need[-1] = max(1, need[-1])
    return need


def _depth_first(program: Program) -> list[int]:
    need = _need(program)
    placed = [False] * len(program.body)
    order: list[int] = []
    for _, root in program.outputs:
        stack = [(root, False)]
        while stack:
            index, ready = stack.pop()
            if placed[index]:
                continue
            if ready:
                placed[index] = True
                order.append(index)
                continue
            stack.append((index, True))
            arguments = sorted(program.body[index].args, key=lambda a: (need[a], -a))
            stack.extend((a, False) for a in arguments)
    return order


def _reordered(program: Program, order: list[int]) -> Program:
    new_index = {old: new for new, old in enumerate(order)}
    body = tuple(program.body[old].renumbered(new_index) for old in order)
    return Program(body, tuple((slot, new_index[i]) for slot, i in program.outputs))
