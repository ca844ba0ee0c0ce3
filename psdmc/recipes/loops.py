"""Loops over entries of arrays, for function bodies made of regions."""

from __future__ import annotations

from psdmc.program.regions import Column, For, Reader, Slice, straight

Block = tuple[str, int, int]
"""A block of a matrix: its array, the index of its first entry, and the number of the matrix's columns."""


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


def copied(rows: int, columns: int, source: Block, target: Block, factor: str | None = None) -> For:
    """A block of a matrix, times a factor, becomes a block of another one."""

    def copy(read: Reader) -> dict[str, Column]:
        (value,) = read("other", 1)
        return {"entry": Column([value * read(factor, 1)[0] if factor else value])}

    inner = For(columns, (Slice("entry", "into"), Slice("other", "row")), (straight(copy),))
    return For(rows, (Slice("into", *target), Slice("row", *source)), (inner,))
