"""Decides whether the matrix products after a function's other operations become loops or straight-line code."""

from __future__ import annotations

from psdmc.program.cost import cost
from psdmc.program.products import LARGE, Product, lines, written_out, zero_columns
from psdmc.program.program import Program
from psdmc.target.costs import Costs

DENSE = 1.1
"""Loops compute all entries: they may have this much more multiplications than products that are written out."""

SPAN = 4
"""Columns that a loop takes at once."""


def in_loops(program: Program, products: tuple[Product, ...], n: int, costs: Costs) -> bool:
    """Return whether loops over n x n matrices are better than straight-line code for these products. They are if
    straight-line code would be too long, or if hardly any entry is always zero."""
    if not products or n < costs.loops_from:
        return False
    widths = [n - zero_columns(program, product) for product in products]
    if n >= LARGE and sum(lines(program, product) for product in products) > len(products) * LARGE**3:
        return min(widths) >= SPAN
    dense = sum(n * n * width for width in widths)
    written = cost(written_out(program, products)).mul - cost(program).mul
    return min(widths) >= SPAN and dense <= DENSE * written
