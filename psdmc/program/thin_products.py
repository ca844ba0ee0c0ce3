"""Products with the inverse of a matrix of limbs on a core (dynamics/arrow.py), done behind a function's limb stages.

Entries of an output in the rows of one limb and the columns of another belong to both. Stages cannot compute them, and need
not: they are the limb's shares T times rows of the core, which are in memory by then. There, all columns are neighbours.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from psdmc.program.cost import Cost
from psdmc.program.program import Slot

AT_ONCE = 4
"""Columns that C computes at once."""

INVERSE = "core_inverse"
"""Vector of V, row by row."""


@dataclass(frozen=True, slots=True)
class Thin:
    """A function's output that a trace with limbs gives as factors.

    name   of the output
    known  its first columns, which the trace gives themselves where a free joint carries the whole robot
    """

    name: str
    known: int = 0


@dataclass(frozen=True, slots=True)
class Shares:
    """Limbs of a group.

    vector    of T: for each row of each limb an entry per carrier
    rows      of the outputs, limb by limb
    carriers  numbers of the core's rows that T's columns belong to
    """

    vector: str
    rows: tuple[int, ...]
    carriers: tuple[int, ...]

    @property
    def size(self) -> int:
        """Entries of T."""
        return len(self.rows) * len(self.carriers)


@dataclass(frozen=True, slots=True)
class ThinProducts:
    """Outputs n x n with x = - V E in the rows of the core, and Y - T x in those of a limb. Stages store V, T and E, and
    store Y in the outputs.

    outputs  their names, and
    known    how many of their first columns stages store themselves
    n        rows, and columns
    core     rows of the core
    groups   of limbs
    """

    outputs: tuple[str, ...]
    known: tuple[int, ...]
    n: int
    core: tuple[int, ...]
    groups: tuple[Shares, ...]

    @staticmethod
    def right(output: str) -> str:
        """Vector of E: the core's rows, one after the other."""
        return f"{output}_core"

    @property
    def sizes(self) -> dict[str, int]:
        """Vectors of V, T and E with their lengths."""
        wide = len(self.core)
        found = {INVERSE: wide**2} | {group.vector: group.size for group in self.groups}
        return found | {self.right(output): wide * self.n for output in self.outputs}

    @property
    def narrowest(self) -> int:
        """The least number of columns of an output that are computed here."""
        return self.n - max(self.known)

    @property
    def written(self) -> set[Slot]:
        """The outputs' rows of the core, and entries of E that are not read."""
        wide, n = len(self.core), self.n
        found: set[Slot] = set()
        for output, known in zip(self.outputs, self.known, strict=True):
            found |= {Slot(output, row * n + k) for row in self.core for k in range(known, n)}
            found |= {Slot(self.right(output), row * n + k) for row in range(wide) for k in range(known)}
        return found

    @property
    def cost(self) -> Cost:
        """Operations on AT_ONCE columns: a multiply-add for each entry of V and T but the first of each row of V."""
        blocks = sum(-(-(self.n - known) // AT_ONCE) for known in self.known)
        mul = blocks * (len(self.core) ** 2 + sum(group.size for group in self.groups))
        add = mul - blocks * len(self.core)
        return Cost(mul, add, div=0, neg=0, sincos=0, fused=add)

    def place(self, slot: Slot, factors: str) -> Slot:
        """Where an entry of a trace's outputs is stored; `factors`: the name of V and T there."""
        row, column = divmod(slot.index, self.n)
        known = dict(zip(self.outputs, self.known, strict=True)).get(slot.vector, self.n)
        if row in self.core and column >= known:
            return Slot(self.right(slot.vector), self.core.index(row) * self.n + column)
        if slot.vector != factors:
            return slot
        number = self.core.index(column)
        if row in self.core:
            return Slot(INVERSE, self.core.index(row) * len(self.core) + number)
        group = next(group for group in self.groups if row in group.rows)
        return Slot(group.vector, group.rows.index(row) * len(group.carriers) + group.carriers.index(number))

    def multiplied(self, stored: Mapping[Slot, Any]) -> Iterator[tuple[Slot, Any]]:
        """The outputs, entry by entry, from all that stages have stored; what they have not stored is zero."""
        n, wide = self.n, len(self.core)
        for output, known in zip(self.outputs, self.known, strict=True):
            for column in range(known, n):
                given = [stored.get(Slot(self.right(output), c * n + column), 0.0) for c in range(wide)]
                found = []
                for number, row in enumerate(self.core):
                    weights = [stored.get(Slot(INVERSE, number * wide + c), 0.0) for c in range(wide)]
                    found.append(-_times(weights, given))
                    yield Slot(output, row * n + column), found[-1]
                for group in self.groups:
                    used = [found[c] for c in group.carriers]
                    for number, row in enumerate(group.rows):
                        first = number * len(used)
                        weights = [stored.get(Slot(group.vector, first + k), 0.0) for k in range(len(used))]
                        own = stored.get(Slot(output, row * n + column), 0.0)
                        yield Slot(output, row * n + column), own - _times(weights, used)


def _times(weights: Sequence[Any], values: Sequence[Any]) -> Any:
    total = 0.0
    for weight, value in zip(weights, values, strict=True):
        total = total + weight * value
    return total
