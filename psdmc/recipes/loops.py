"""Loops over entries of arrays, for function bodies made of regions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import is_zero
from psdmc.program.regions import Column, For, Reader, Slice, straight


def filled(array: str, count: int) -> For:
    """All entries are zero."""
    return For(count, (Slice("entry", array),), (straight(lambda read: {"entry": Column([0.0])}),))


def diagonal(count: int, entry: Slice) -> For:
    """These entries are one."""
    return For(count, (entry,), (straight(lambda read: {"entry": Column([1.0])}),))


def one_more(count: int, entry: Slice) -> For:
    """Each entry grows by one."""
    more = straight(lambda read: {"entry": Column([read("entry", 1)[0] + 1.0])})
    return For(count, (entry,), (more,))


def added(count: int, entry: Slice, other: Slice, factor: str | None = None) -> For:
    """Each entry becomes its sum with another one, times a factor."""

    def sums(read: Reader) -> dict[str, Column]:
        more = read("other", 1)[0]
        return {"entry": Column([read("entry", 1)[0] + (more * read(factor, 1)[0] if factor else more)])}

    return For(count, (entry, other), (straight(sums),))


@dataclass(frozen=True, slots=True)
class Block:
    """A matrix in an array, or a part of one.

    array   name of the array
    row     distance of the first entries of two rows that follow each other
    column  distance of two entries in a row
    first   index of the first entry
    """

    array: str
    row: int
    column: int = 1
    first: int = 0

    def turned(self) -> Block:
        """The transpose."""
        return Block(self.array, self.column, self.row, self.first)

    def moved(self, row: int, column: int = 0) -> Block:
        """The part that begins at this row and this column."""
        first = self.first + row * self.row + column * self.column
        return Block(self.array, self.row, self.column, first)


def copied(rows: int, columns: int, source: Block, target: Block, factor: str | None = None) -> For:
    """A matrix, times a factor, becomes a part of another one."""

    def copy(read: Reader) -> dict[str, Column]:
        (value,) = read("other", 1)
        return {"entry": Column([value * read(factor, 1)[0] if factor else value])}

    entry = Slice("entry", "into", 0, target.column), Slice("other", "from", 0, source.column)
    place = (
        Slice("into", target.array, target.first, target.row),
        Slice("from", source.array, source.first, source.row),
    )
    return For(rows, place, (For(columns, entry, (straight(copy),)),))


@dataclass(frozen=True, slots=True)
class Product:
    """How a matrix product is used: the target becomes left right, or grows by it, or loses it.

    rows, columns  shape of the product
    added          whether the target keeps its value, which the product is added to
    negative       whether the product is subtracted
    """

    left: Block
    right: Block
    target: Block
    rows: int
    columns: int
    added: bool = False
    negative: bool = False

    def by_rows(self, kept: Sequence[Sequence[int]]) -> Iterator[For]:
        """Loops for a left factor with zeros: `kept` has the other entries of each row. Neighbouring rows with the same
        ones share a loop. Sums of no terms are left out if they would be added."""
        for own, numbers in groupby(range(len(kept)), key=lambda k: tuple(kept[k])):
            rows = tuple(numbers)
            if own or not self.added:
                left, target = self.left.moved(rows[0]), self.target.moved(rows[0])
                yield replace(self, left=left, target=target, rows=len(rows)).loop(own)

    def loop(self, kept: Sequence[int]) -> For:
        """The loop over rows and columns. `kept` are the terms of each entry."""
        left, right, target = self.left, self.right, self.target

        def entry(read: Reader) -> dict[str, Column]:
            total: Scalar = read("entry", 1)[0] if self.added else 0.0
            for k in kept:
                term = read("left_i", 1, 1, k * left.column)[0] * read("right_j", 1, 1, k * right.row)[0]
                total = total - term if self.negative else total + term
            return {"entry": Column([total])}

        place = (
            Slice("left_i", left.array, left.first, left.row),
            Slice("target_i", target.array, target.first, target.row),
        )
        inner = (
            Slice("entry", "target_i", 0, target.column),
            Slice("right_j", right.array, right.first, right.column),
        )
        return For(self.rows, place, (For(self.columns, inner, (straight(entry),)),))


def nonzero(rows: Sequence[Sequence[Scalar]]) -> list[tuple[int, ...]]:
    """Return for each row the indices of the entries that are not zero at every state."""
    return [tuple(k for k, x in enumerate(row) if not is_zero(x)) for row in rows]
