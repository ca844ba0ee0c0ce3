"""A pass of the code generator: it orders the instructions of a PROGRAM (list of operations to generate). In the new
order, each value is needed for few instructions after it is computed."""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush

from psdmc.program.passes.schedule import live_values, reordered
from psdmc.program.program import Program

Tie = Callable[[int, int], tuple[int, int]]
"""Of an instruction and the time at which the newest of its arguments was computed: the smaller comes first."""

TIES: tuple[Tie, ...] = (
    lambda instruction, newest: (0, instruction),
    lambda instruction, newest: (-newest, -instruction),
)
"""Among equals the first in the PROGRAM, or what goes on with what was computed last."""


def free_registers(program: Program) -> Program:
    """Return the PROGRAM (list of operations to generate) in an order in which few values are alive at a time. A value
    is alive if it is computed and still needed.

    Of all instructions whose arguments are known, the next one is the one that leaves the fewest values alive. An
    instruction that is the last to read two values comes before one that reads values which are needed later. The
    reordering is repeated as long as it lowers the number of values alive.

    The given order is kept if the new one would hold more values alive over the whole PROGRAM. The pass `schedule`
    orders instructions output by output instead, and keeps values alive that later outputs share with the first.

    Needs:  every argument precedes its use; every instruction is needed.
    Keeps:  output values, bit for bit; output names and order; the set of instructions.
    Gives:  a sum of live values over all instructions that is no larger than before.
    """
    while True:
        orders = [_Listing(program, tie).listed() for tie in TIES]
        alive = [live_values(program, order) for order in orders]
        if min(alive) >= live_values(program):
            return program
        program = reordered(program, orders[alive.index(min(alive))])


class _Listing:
    """One order. Loads and constants come first: they count for nothing."""

    def __init__(self, program: Program, tie: Tie) -> None:
        self.tie = tie
        self.args = [tuple(dict.fromkeys(instr.args)) for instr in program.body]
        self.users: list[list[int]] = [[] for _ in program.body]
        for i, args in enumerate(self.args):
            for a in args:
                self.users[a].append(i)
        self.unread = [len(users) for users in self.users]
        self.unknown = [sum(bool(self.args[a]) for a in args) for args in self.args]
        self.order = [i for i, args in enumerate(self.args) if not args]
        self.time = [0] * len(program)
        self.ready: list[tuple[int, int, int, int]] = []

    def listed(self) -> list[int]:
        placed = [not args for args in self.args]
        for i, args in enumerate(self.args):
            if args and not self.unknown[i]:
                self._offer(i)
        while self.ready:
            i = heappop(self.ready)[-1]
            if not placed[i]:
                placed[i] = True
                self._place(i)
        return self.order

    def _offer(self, i: int) -> None:
        """As an instruction that can come next; again where it has become one that ends a life."""
        ended = sum(self.unread[a] == 1 for a in self.args[i] if self.args[a])
        newest = max(self.time[a] for a in self.args[i])
        heappush(self.ready, (bool(self.users[i]) - ended, *self.tie(i, newest), i))

    def _place(self, i: int) -> None:
        self.order.append(i)
        self.time[i] = len(self.order)
        for a in self.args[i]:
            self.unread[a] -= 1
            if self.unread[a] == 1:
                for user in self.users[a]:
                    if self.time[user] == 0 and not self.unknown[user]:
                        self._offer(user)
        for user in self.users[i]:
            self.unknown[user] -= 1
            if not self.unknown[user]:
                self._offer(user)
