"""Products of matrices at the end of a function. C code computes them in loops, or they are written out entry by entry.

A Product is one of square matrices. It is not in the function's PROGRAM (list of operations to generate).

ThinProducts belong to functions with the inverse of a mass matrix, for robots with limbs: equal branches, such as legs,
on a core (the other joints). The code for limbs runs in stages, one limb after the other. An entry of the output in the
row of one limb and the column of another depends on both, so no stage can compute it. The entry is a product of the
limb's factor T with rows of the core (dynamics/arrow.py). After the stages, these rows are in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isqrt
from operator import mul
from typing import Any

from psdmc.program.cost import Cost, cost
from psdmc.program.interpret import Value, replayed
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Tracer
from psdmc.target.target import Costs

LARGE = 12
"""Rows from which products with more than LARGE^3 lines are loops, over entries that are always zero too, and states go one
after the other: lines take gcc minutes (18 rows, written out for one state and for lanes: more than one, and 600 MiB). A
hand of four fingers has few lines."""


@dataclass(frozen=True, slots=True)
class Product:
    """A matrix product at the end of a function: output = -(left @ right), with n x n matrices.

    output  name of the function's output that is the product
    left    name of the left factor, an output that the traced arithmetic computes, row by row
    right   name of the right factor, which the traced arithmetic computes column by column; column j of derivatives is
            by joint j
    """

    output: str
    left: str
    right: str


def written_out(program: Program, products: tuple[Product, ...]) -> Program:
    """Return the PROGRAM (list of operations to generate) with every entry of each matrix product computed by
    instructions. The product is stored in place of the product's right factor. Without products, the PROGRAM is
    returned unchanged."""
    if not products:
        return program
    tracer = Tracer()
    values = dict(zip((slot for slot, _ in program.outputs), replayed(program, tracer, {}), strict=True))
    by_right = {product.right: product for product in products}
    outputs: list[tuple[Slot, Value]] = []
    for slot, value in values.items():
        product = by_right.get(slot.vector)
        if product is None:
            outputs.append((slot, value))
        elif slot.index == 0:
            outputs += _multiplied(product, values)
    return tracer.finish(outputs)


def _multiplied(product: Product, values: dict[Slot, Value]) -> list[tuple[Slot, Value]]:
    n = isqrt(sum(slot.vector == product.right for slot in values))
    found: list[tuple[Slot, Value]] = []
    for i in range(n):
        for j in range(n):
            total: Value = 0.0
            for k in range(n):
                total = total + values[Slot(product.left, i * n + k)] * values[Slot(product.right, j * n + k)]
            found.append((Slot(product.output, i * n + j), -total))
    return found


def lines(program: Program, product: Product) -> int:
    """Return the number of multiplications that a matrix product takes if it is written out entry by entry. Entries
    that are zero at every state need none."""
    stored = {slot: program.body[i].value != 0.0 for slot, i in program.outputs}
    n = isqrt(sum(slot.vector == product.right for slot in stored))
    left = [sum(stored[Slot(product.left, i * n + k)] for i in range(n)) for k in range(n)]
    right = [sum(stored[Slot(product.right, j * n + k)] for j in range(n)) for k in range(n)]
    return sum(map(mul, left, right))


def zero_columns(program: Program, product: Product) -> int:
    """Return the number of leading columns of a product's right factor that are zero at every state."""
    stored = {
        slot.index: program.body[i].value for slot, i in program.outputs if slot.vector == product.right
    }
    n = isqrt(len(stored))
    return next((j for j in range(n) if any(stored[j * n + k] != 0.0 for k in range(n))), n)


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


# Products of thin factors, for robots with limbs


AT_ONCE = 4
"""Columns that C computes at once."""

INVERSE = "core_inverse"
"""Vector of V, row by row."""


@dataclass(frozen=True, slots=True)
class Thin:
    """An output matrix that the code for a robot with limbs (equal branches, such as legs) computes as a product of
    factors.

    name   name of the output
    known  number of its first columns that are computed without the factors, if a floating base carries the whole robot
    below  name of an output with the same columns, whose rows belong to contacts on limbs; empty: there is none
    """

    name: str
    known: int = 0
    below: str = ""


@dataclass(frozen=True, slots=True)
class Shares:
    """The place of the factor T of one group of limbs (equal branches, such as legs). T relates the limbs' rows to rows
    of the core (the other joints); ThinProducts explains the product.

    vector    name of the vector of T: one row after the other, with an entry for each carrier
    rows      rows of the output matrix that belong to the group, limb by limb
    carriers  for each column of T, the row of the core that belongs to it, counted within the core from 0
    is_below  whether the rows are those of the outputs `below`
    """

    vector: str
    rows: tuple[int, ...]
    carriers: tuple[int, ...]
    is_below: bool = False

    @property
    def size(self) -> int:
        """Entries of T."""
        return len(self.rows) * len(self.carriers)

    def entry(self, number: int, carrier: int) -> Slot:
        """Return the place in memory of the entry of T in the row `rows[number]` and the column `carriers[carrier]`."""
        return Slot(self.vector, number * len(self.carriers) + carrier)


@dataclass(frozen=True, slots=True)
class ThinProducts:
    """Outputs with n columns that are products of factors, for a robot with limbs (equal branches, such as legs) on a
    core.

    The rows x of the core (the other joints) are x = -V E. The rows of a limb are Y - T x. Here V is the core's block
    of the inverse mass matrix, E the right side, T the factor of the limb. The code for limbs computes V, T and E, and
    stores Y in the outputs first. If a floating base is the whole core, the code for limbs stores x there instead of
    computing V and E.

    outputs    names of the outputs
    known      for each output, the number of first columns that are stored without the products
    n          number of columns
    core       rows of the core
    groups     the factor T of each group of limbs, for rows of the outputs or of those below
    below      for each output, the name of an output with the rows of contacts on limbs; () if there are none
    is_solved  whether the code for limbs stores x
    """

    outputs: tuple[str, ...]
    known: tuple[int, ...]
    n: int
    core: tuple[int, ...]
    groups: tuple[Shares, ...]
    below: tuple[str, ...] = ()
    is_solved: bool = False

    @staticmethod
    def right(output: str) -> str:
        """Return the name of the vector of the factor E of an output: the rows of the core, one after the other."""
        return f"{output}_core"

    @property
    def sizes(self) -> dict[str, int]:
        """Return the vectors of the factors V, T and E: name -> length."""
        wide = len(self.core)
        found = {group.vector: group.size for group in self.groups}
        if self.is_solved:
            return found
        return {INVERSE: wide**2} | found | {self.right(output): wide * self.n for output in self.outputs}

    @property
    def narrowest(self) -> int:
        """Return the smallest number of columns that the products compute in any of the outputs."""
        return self.n - max(self.known)

    @property
    def written(self) -> set[Slot]:
        """Return the entries that the code for limbs does not store. These are the outputs' rows of the core, which the
        products compute, and entries of E that the products do not read."""
        wide, n = len(self.core), self.n
        found: set[Slot] = set()
        if self.is_solved:
            return found
        for output, known in zip(self.outputs, self.known, strict=True):
            found |= {Slot(output, row * n + k) for row in self.core for k in range(known, n)}
            found |= {Slot(self.right(output), row * n + k) for row in range(wide) for k in range(known)}
        return found

    @property
    def cost(self) -> Cost:
        """Return the cost of the products. C code computes AT_ONCE columns together, and one operation on them counts
        once. Each entry of V and T costs a multiply-add, the first of each row of V a multiplication."""
        blocks = sum(-(-(self.n - known) // AT_ONCE) for known in self.known)
        wide = 0 if self.is_solved else len(self.core)
        mul = blocks * (wide**2 + sum(group.size for group in self.groups))
        add = mul - blocks * wide
        return Cost(mul, add, div=0, neg=0, sincos=0, fused=add)

    def place(self, slot: Slot) -> Slot:
        """Return the place (slot) in memory of an entry that the recorded arithmetic computes."""
        if self.is_solved or slot.vector not in self.outputs:
            return slot
        row, column = divmod(slot.index, self.n)
        if row in self.core and column >= self.known[self.outputs.index(slot.vector)]:
            return Slot(self.right(slot.vector), self.core.index(row) * self.n + column)
        return slot

    def place_of_factor(self, row: int, column: int, rows: int) -> Slot:
        """Return the place in memory of an entry of the factors V and T. The rows of outputs below follow those of the
        outputs, which are `rows` in number."""
        number = self.core.index(column)
        if row in self.core:
            return Slot(INVERSE, self.core.index(row) * len(self.core) + number)
        own = row - rows if row >= rows else row
        group = next(each for each in self.groups if own in each.rows and each.is_below == (row >= rows))
        return group.entry(group.rows.index(own), group.carriers.index(number))

    def multiplied(self, stored: Mapping[Slot, Any]) -> Iterator[tuple[Slot, Any]]:
        """Yield each entry of the outputs that the products compute, as (slot, value). `stored` are the factors V, T, E
        and Y; entries that are missing count as zero."""
        n, wide = self.n, len(self.core)
        beneath = self.below or ("",) * len(self.outputs)
        for output, below, known in zip(self.outputs, beneath, self.known, strict=True):
            for column in range(known, n):
                places = [Slot(output, row * n + column) for row in self.core]
                if self.is_solved:
                    found = [stored.get(place, 0.0) for place in places]
                else:
                    given = [stored.get(Slot(self.right(output), c * n + column), 0.0) for c in range(wide)]
                    rows = [[Slot(INVERSE, c * wide + k) for k in range(wide)] for c in range(wide)]
                    found = [-_times([stored.get(slot, 0.0) for slot in row], given) for row in rows]
                    yield from zip(places, found, strict=True)
                for group in self.groups:
                    used = [found[c] for c in group.carriers]
                    for number, row in enumerate(group.rows):
                        place = Slot(below if group.is_below else output, row * n + column)
                        total = stored.get(place, 0.0)
                        for k, value in enumerate(used):
                            total = total - stored.get(group.entry(number, k), 0.0) * value
                        yield place, total


def _times(weights: Sequence[Any], values: Sequence[Any]) -> Any:
    total = 0.0
    for weight, value in zip(weights, values, strict=True):
        total = total + weight * value
    return total
