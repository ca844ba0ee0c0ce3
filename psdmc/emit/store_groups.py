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
        self._starts = {
            vector: [*range(0, size - GROUP, GROUP), size - GROUP] for vector, size in sizes.items()
        }
        self._missing = {
            Slot(vector, start): GROUP for vector, starts in self._starts.items() for start in starts
        }

    def completed_by(self, slot: Slot) -> list[Slot]:
        """The first outputs of the groups that are complete with this output."""
        complete = []
        for start in self._starts.get(slot.vector, []):
            if start <= slot.index < start + GROUP:
                first = Slot(slot.vector, start)
                self._missing[first] -= 1
                if self._missing[first] == 0:
                    complete.append(first)
        return complete
