"""The statements of which the body of a generated C function consists, and the classes that hold them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from psdmc.program.products import Product, zero_columns
from psdmc.program.program import Op, Program, Slot

KEPT, KEPT_REALS = "kept", "kept_reals"
"""Vectors between the parts of a long body: of values, and of those that are the same for all states."""

BETWEEN = frozenset({KEPT, KEPT_REALS})


def spread(text: str, uniform: bool) -> str:
    """The text as a `V`."""
    return f"SPLAT({text})" if uniform else text


@dataclass(frozen=True, slots=True)
class Load:
    """A statement that reads one entry of an input vector. A uniform entry is equal for all states of a batch."""

    name: str
    vector: str
    index: int
    uniform: bool

    @property
    def line(self) -> str:
        if self.uniform:
            return f"const real {self.name} = {self.vector}[{self.index}]"
        return f"const V {self.name} = LOAD({self.vector}, {self.index})"


@dataclass(frozen=True, slots=True)
class Step:
    """A C statement `const V name = text;` or `const real name = text;`, which stores the value of an expression in a C
    variable. V is a real number or a SIMD vector. If `uniform`, the value is equal for all states of a batch and has
    the type real."""

    name: str
    text: str
    uniform: bool

    @property
    def line(self) -> str:
        return f"const {'real' if self.uniform else 'V'} {self.name} = {self.text}"


@dataclass(frozen=True, slots=True)
class Store:
    """A C statement `vector[index] = text`, written as a call of `macro`. If `uniform`, the value is equal for all
    states of a batch, and is copied to all SIMD lanes first."""

    vector: str
    index: int
    text: str
    uniform: bool
    macro: str = "STORE"

    @property
    def line(self) -> str:
        if self.vector == KEPT_REALS:
            return f"{self.vector}[{self.index}] = {self.text}"
        text = spread(self.text, self.uniform)
        if self.vector == KEPT:
            return f"{self.vector}[{self.index}] = {text}"
        return f"{self.macro}({self.vector}, {self.index}, {text})"


@dataclass(frozen=True, slots=True)
class Zeros:
    """A statement that sets `count` consecutive outputs to zero. If the vector is stored in groups of four, zeros are
    stored in groups of four, too."""

    vector: str
    first: int
    count: int

    @property
    def line(self) -> str:
        return f"STORE_ZEROS({self.vector}, {self.first}, {self.count})"


@dataclass(frozen=True, slots=True)
class Cleared:
    """A statement that sets `count` consecutive outputs to zero in code for one state. Code for a batch, with one state
    per SIMD lane, stores each zero alone."""

    vector: str
    first: int
    count: int

    @property
    def line(self) -> str:
        return f"CLEAR({self.vector}, {self.first}, {self.count})"

    @property
    def slots(self) -> tuple[Slot, ...]:
        return tuple(Slot(self.vector, self.first + k) for k in range(self.count))


@dataclass(frozen=True, slots=True)
class GroupStore:
    """One C statement that stores four neighbouring outputs, `vector[index]` to `vector[index + 3]`.

    The statement is a call of the macro STORE_GROUP with the C texts of the four values. It takes effect in code that
    computes one state per SIMD lane and writes each state into a row of the output array. In all other code, the
    macro does nothing, and one statement per output (class Store) stores the values.
    """

    vector: str
    index: int
    texts: tuple[str, ...]

    @property
    def line(self) -> str:
        return f"STORE_GROUP({self.vector}, {self.index}, {', '.join(self.texts)})"


# Outputs of a batch in groups of four
#
# A group is transposed in registers, and each state's four entries are stored directly in its row of the output
# array. The alternative collects the whole matrix in a block first. It needs a second pass and stack memory (n l
# vectors: 13.5 KiB for a six-joint regressor). On KR6 with eight lanes, groups reduce the regressor from 31.6 to
# 23.8 ns per state, and the mass matrix from 9.5 to 8.8 ns.


GROUP = 4
"""Outputs of a group: the transposition's last two stages, which are the same for every vector of four lanes or more."""


class StoreGroups:
    """Finds out when a group of four consecutive outputs can be stored. Outputs are computed one after the other; a
    group is complete when the values of all four are known.

    If the number of outputs is no multiple of four, the last group overlaps the group before it and stores equal values
    again.
    """

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self._last = {vector: size - GROUP for vector, size in sizes.items()}
        self._missing: dict[Slot, int] = {}

    def completed_by(self, slot: Slot) -> list[Slot]:
        """Return the groups of four outputs, by their first output, that are complete once this output is known."""
        complete = []
        for start in self._starts(slot):
            first = Slot(slot.vector, start)
            left = self._missing[first] = self._missing.get(first, GROUP) - 1
            if left == 0:
                complete.append(first)
        return complete

    def _starts(self, slot: Slot) -> list[int]:
        """The first outputs of the groups that an output is in: one or two."""
        last = self._last.get(slot.vector)
        if last is None:
            return []
        own = slot.index - slot.index % GROUP
        starts = [own] if own < last else []
        return [*starts, last] if slot.index >= last else starts


# Matrix products after the straight-line code
#
# For one state, a product is a loop; for a batch with one state per SIMD lane, each entry is one statement.
# For one state, straight-line code slows down if it is longer than some 27 KB. For a batch, loops and statements
# are equally fast, because both run out of registers. Statements then need no memory for the factors.


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


# The body


Line = Step | Store | Zeros | Cleared | GroupStore | Entry | Multiplication


@dataclass(frozen=True, slots=True)
class Angle:
    """C text of one angle, and the C variables for its sine and cosine; None if the value is not needed."""

    text: str
    sine: str | None
    cosine: str | None


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a generated function body: statements that read inputs, statements that compute, and then the sines and
    cosines of angles that were computed.

    Inputs that no angle depends on are read in the last section. Such inputs need not be kept in registers while the C
    library computes sines. Outputs are stored after all inputs are read, because an output array may be one of the
    input arrays.
    """

    loads: tuple[Load, ...]
    steps: tuple[Line, ...]
    angles: tuple[Angle, ...]
    number: int


@dataclass(frozen=True, slots=True)
class Body:
    """The body of a generated C function, ready for the template.

    sections  the statements
    unused    inputs that the body never reads
    products  matrix products after all other statements
    calls     operations that are written as C macros
    parts     if the body is long, the C functions that compute it one after the other; `sections` is then empty
    kept      C declarations of the arrays that pass values from one part to the next
    """

    sections: tuple[Section, ...]
    unused: tuple[str, ...]
    products: tuple[Multiplication, ...] = ()
    calls: frozenset[Op] = frozenset()
    parts: tuple[Part, ...] = ()
    kept: tuple[str, ...] = ()

    @property
    def has_clears(self) -> bool:
        """Whether runs of zeros are cleared."""
        return any(isinstance(line, Cleared) for section in self.sections for line in section.steps)


@dataclass(frozen=True, slots=True)
class Part:
    """A static C function that computes one part of a long function body.

    parameters  C declarations of its parameters
    arguments   C text of the arguments in its call
    direct      outputs for which the batch variant passes rows of the output array
    body        C statements
    """

    parameters: tuple[str, ...]
    arguments: tuple[str, ...]
    direct: tuple[str, ...]
    body: Body
