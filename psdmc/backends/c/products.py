"""Products of matrices behind a body: loops over small vectors for one state, line by line for one state per lane.

Straight-line code for one state slows down beyond some 27 KB; lanes run out of registers either way and are as fast with
each entry in a line, which needs no memory for the factors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from psdmc.backends.c.store_groups import GROUP, StoreGroups
from psdmc.program.products import Product, zero_columns
from psdmc.program.program import Program, Slot


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry of a factor: KEEP takes one of a right factor, NAME one of a left factor, an output that is stored beside."""

    macro: Literal["KEEP", "NAME"]
    matrix: str
    row: int
    column: int
    text: str

    @property
    def line(self) -> str:
        return f"{self.macro}({self.matrix}, {self.row}, {self.column}, {self.text})"


@dataclass(frozen=True, slots=True, order=True)
class Shape:
    """n x n, where the right factor's first `zero` columns are always zero and not kept."""

    n: int
    zero: int

    @property
    def lines(self) -> tuple[str, ...]:
        """C: entry by entry, in groups for the form that writes rows."""
        groups, n = StoreGroups({"product": self.n**2}), self.n
        found = []
        for index in range(n * n):
            i, j = divmod(index, n)
            zero = j < self.zero
            found.append(
                f"ZERO_ENTRY(product, {i}, {j})" if zero else f"PRODUCT_ENTRY(left, right, product, {i}, {j})"
            )
            for first in groups.completed_by(Slot("product", index)):
                names = (f"product##_##{k // n}##_##{k % n}" for k in range(first.index, first.index + GROUP))
                found.append(f"STORE_GROUP(product, {first.index}, {', '.join(names)})")
        return tuple(found)


@dataclass(frozen=True, slots=True)
class Multiplication:
    """output = - left right."""

    output: str
    left: str
    right: str
    shape: Shape

    @property
    def line(self) -> str:
        return f"MINUS_PRODUCT_{self.shape.zero}({self.left}, {self.right}, {self.output})"


def multiplication(program: Program, product: Product, sizes: Mapping[str, int]) -> Multiplication:
    """A product as C does it behind a PROGRAM; `sizes` are the outputs'."""
    shape = Shape(math.isqrt(sizes[product.output]), zero_columns(program, product))
    return Multiplication(product.output, product.left, product.right, shape)
