"""Small functions of loops and calls."""

from __future__ import annotations

from psdmc.program.regions import Column, For, Reader, Regions, Slice, straight

MATRICES = [(3, 2), (4, 4), (1, 5), (6, 3)]


def multiplied(rows: int, columns: int) -> Regions:
    """c = a b of matrices rows x columns and columns x rows."""

    def entry(read: Reader) -> dict[str, Column]:
        products = [x * y for x, y in zip(read("a_i", columns), read("b_k", columns, rows), strict=True)]
        return {"entry": Column([sum(products[1:], products[0])])}

    inner = For(rows, (Slice("b_k", "b"), Slice("entry", "c_i")), (straight(entry),))
    outer = For(rows, (Slice("a_i", "a", 0, columns), Slice("c_i", "c", 0, rows)), (inner,))
    return Regions({}, (outer,))


def doubled(function: str, given: list[list[float]]) -> tuple[list[list[float]], list[float]]:
    """A called function: twice its input, whose first entry must be positive."""
    assert function == "double"
    return [[2.0 * x for x in given[0]]], [given[0][0]]
