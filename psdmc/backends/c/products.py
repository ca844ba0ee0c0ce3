"""Matrix products that follow the straight-line code of a function. For one state, a product is a loop; for a batch
with one state per SIMD lane, each entry is one statement.

For one state, straight-line code slows down if it is longer than some 27 KB. For a batch, loops and statements are
equally fast, because both run out of registers. Statements then need no memory for the factors.
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
    """C statement for one entry of a factor in a matrix product, as a call of the C macro KEEP or NAME. KEEP saves an
    entry of the right factor. NAME gives a name to an entry of the left factor, which is also an output of the
    function."""

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
    """The shape of a product of two n x n matrices. The first `zero` columns of the right factor are zero, not saved."""

    n: int
    zero: int

    @property
    def lines(self) -> tuple[str, ...]:
        """Return the C statements of the matrix product, one for each entry. Batch code that writes into the rows of
        the output array has further statements, which store four entries at once."""
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
    """Return the C code of a matrix product that follows a PROGRAM (the list of operations to generate). `sizes` are
    the lengths of the output vectors."""
    shape = Shape(math.isqrt(sizes[product.output]), zero_columns(program, product))
    return Multiplication(product.output, product.left, product.right, shape)
