"""Products with the inverse of a matrix of limbs on a core (dynamics/arrow.py), computed after a function's limb
stages.

An entry of an output in the row of one limb and the column of another belongs to both limbs, so stages cannot compute
it. It is a product of the limb's factor T with rows of the core. These rows are in memory after the stages, with all
columns next to each other.
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
    """An output of a function that a trace with limbs computes as factors of a matrix product.

    name   of the output
    known  number of its first columns that the trace computes directly if a floating base carries the whole robot
    """

    name: str
    known: int = 0


@dataclass(frozen=True, slots=True)
class Shares:
    """The factor T of one group of limbs in matrix products (ThinProducts).

    vector    name of the vector of T: for each row of each limb an entry per carrier
    rows      the rows of the outputs that belong to the group, limb by limb
    carriers  numbers of the core's rows to which T's columns belong
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
    """Outputs n x n that are x = - V E in the rows of the core, and Y - T x in the rows of a limb. Stages compute V, T
    and E, and store Y in the outputs.

    outputs  names of the outputs
    known    for each output, how many of its first columns stages store themselves
    n        number of rows and columns
    core     rows of the core
    groups   the factor T of each group of limbs
    """

    outputs: tuple[str, ...]
    known: tuple[int, ...]
    n: int
    core: tuple[int, ...]
    groups: tuple[Shares, ...]

    @staticmethod
    def right(output: str) -> str:
        """Return the name of the vector of E: the core's rows, one after the other."""
        return f"{output}_core"

    @property
    def sizes(self) -> dict[str, int]:
        """The vectors of V, T and E with their lengths."""
        wide = len(self.core)
        found = {INVERSE: wide**2} | {group.vector: group.size for group in self.groups}
        return found | {self.right(output): wide * self.n for output in self.outputs}

    @property
    def narrowest(self) -> int:
        """The least number of columns that these products compute in an output."""
        return self.n - max(self.known)

    @property
    def written(self) -> set[Slot]:
        """The slots that stages need not store: the outputs' rows of the core, and entries of E that are not read."""
        wide, n = len(self.core), self.n
        found: set[Slot] = set()
        for output, known in zip(self.outputs, self.known, strict=True):
            found |= {Slot(output, row * n + k) for row in self.core for k in range(known, n)}
            found |= {Slot(self.right(output), row * n + k) for row in range(wide) for k in range(known)}
        return found

    @property
    def cost(self) -> Cost:
        """The operations on AT_ONCE columns: a multiply-add for each entry of V and T except the first of each row of
        V."""
        blocks = sum(-(-(self.n - known) // AT_ONCE) for known in self.known)
        mul = blocks * (len(self.core) ** 2 + sum(group.size for group in self.groups))
        add = mul - blocks * len(self.core)
        return Cost(mul, add, div=0, neg=0, sincos=0, fused=add)

    def place(self, slot: Slot, factors: str) -> Slot:
        """Return the slot in which an entry of a trace's outputs is stored. `factors` is the trace's name for V and T."""
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
        """Compute the outputs, entry by entry, from all that stages have stored. Slots that they have not stored are
        zero."""
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
