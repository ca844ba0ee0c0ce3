"""Matrices in groups of four outputs: a group is transposed in registers and stored directly into a batch's rows.

A block that holds a whole matrix first costs stack (n l vectors: 13.5 KiB for a six-joint regressor) and a second pass.
KR6, eight lanes: regressor 31.6 -> 23.8 ns a state, mass matrix 9.5 -> 8.8 ns.
"""

from __future__ import annotations

from collections.abc import Mapping

from psdmc.program.program import Slot

GROUP = 4
"""Outputs of a group: the transposition's last two stages, which are the same for every vector of four lanes or more."""


class StoreGroups:
    """Which groups of consecutive outputs are complete, while outputs become known one after the other.

    The last group overlaps the one before it where the size is no multiple of four: it stores equal values twice.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self._last = {vector: size - GROUP for vector, size in sizes.items()}
        self._missing: dict[Slot, int] = {}

    def completed_by(self, slot: Slot) -> list[Slot]:
        """The first outputs of the groups that are complete with this output."""
        complete = []
        for start in self._starts(slot):
            first = Slot(slot.vector, start)
            left = self._missing[first] = self._missing.get(first, GROUP) - 1
            if left == 0:
                complete.append(first)
        return complete

    def _starts(self, slot: Slot) -> list[int]:
        """The first outputs of the groups that an output is in: one or two."""
        last = self._last.get(slot.vector)
        if last is None:
            return []
        own = slot.index - slot.index % GROUP
        starts = [own] if own < last else []
        return [*starts, last] if slot.index >= last else starts
