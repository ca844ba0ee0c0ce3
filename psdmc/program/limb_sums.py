"""Sums over equal limbs in a trace (recorded operations) that contains one limb of each group; and which values differ
between limbs.

A sum is recorded as an input of the trace, as `limb_stages` needs it. Only the object LimbSums knows which value is
summed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from weakref import proxy

from psdmc.program.lanes import Lanes
from psdmc.program.limb_program import LimbGroup
from psdmc.program.program import Op, Slot
from psdmc.program.trace import Constant, Symbol, Tracer, arguments_of, constants_of, group_name

CORE = -1
"""In the place of a group's number, for what is the same for all limbs."""


class LimbSums:
    """The sums over limbs in one trace (recorded operations). Creating the object registers it with the trace's tracer.

    partials  for each group, index of a value in the trace -> number of the sum over the limbs
    summed    index of a sum in the trace -> index of the value that is summed
    """

    def __init__(self, tracer: Tracer, counts: Sequence[int]) -> None:
        # The tracer owns its sums. A cycle would keep each trace until Python looks for cycles.
        self.tracer: Tracer = proxy(tracer)
        self.counts = counts
        self.partials: list[dict[int, int]] = [{} for _ in counts]
        self.summed: dict[int, int] = {}
        self._names = [LimbGroup(number, count, (), (), ()).sum for number, count in enumerate(counts)]
        self._owners = {constants_of(number): number for number in range(len(counts))}
        self._groups: list[int] = []
        tracer.limb_sums = self

    def add_input(self, vector: str, group: int) -> None:
        """Declare that the entries of an input vector of the trace differ between the limbs of a group."""
        self._owners[vector] = group

    def group_of(self, index: int) -> int:
        """Return the number of the group between whose limbs a value differs. Return CORE if the value is equal for all
        limbs.

        index  index of the value in the trace (recorded operations)
        """
        groups, steps = self._groups, self.tracer.steps
        for k in range(len(groups), index + 1):
            op, a, b = steps[k]
            if b is not None:
                groups.append(max(groups[a], groups[b]))
            elif op is Op.LOAD:
                groups.append(self._owners.get(a.vector, CORE))
            else:
                groups.append(max((groups[each] for each in arguments_of(steps[k])), default=CORE))
        return groups[index]

    def total(self, group: int, value: Symbol | Constant) -> Symbol | Constant:
        """Return the sum of a value over the limbs of a group. The given scalar has one value per limb."""
        if isinstance(value, Lanes):
            return math.fsum(value.values)
        if not isinstance(value, Symbol) or self.group_of(value.index) != group:
            return value * self.counts[group]
        numbers = self.partials[group]
        number = numbers.setdefault(value.index, len(numbers))
        found = self.tracer.symbol(Slot(self._names[group], number))
        self.summed[found.index] = value.index
        return -found if value.negative else found

    def stand_ins(self, vector: str, values: Sequence[Symbol | Constant]) -> list[Symbol]:
        """Return new inputs of the trace (recorded operations) that take the place of the given values. A new input
        differs between limbs if the value does."""
        return [self._stand_in(vector, k, value) for k, value in enumerate(values)]

    def _stand_in(self, vector: str, number: int, value: Symbol | Constant) -> Symbol:
        group = self.group_of(value.index) if isinstance(value, Symbol) else CORE
        if group != CORE:
            vector = f"{group_name(group)}_{vector}"
            self.add_input(vector, group)
        return self.tracer.symbol(Slot(vector, number))
