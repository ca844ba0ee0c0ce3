"""The inputs and outputs of a generated function: named quantities with sizes in words. Lowering computes them, and
emission prints them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from psdmc.errors import InternalError
from psdmc.program.dimensions import NUMBER, Dimension, dimension_of, times
from psdmc.program.factorisation import SymmetricMatrix
from psdmc.program.products import Product
from psdmc.program.thin_products import Thin

WORDS = ("n", "nq", "nv", "nx", "l", "frames", "contacts", "contact_rows", "nonzeros")
"""Sizes that depend on the robot: joints, length of q, of qd, and of both together, base parameters, named frames, contacts
and the rows of all contacts; and, of a function that packs a matrix, entries that it puts out."""


@dataclass(frozen=True, slots=True)
class Sizes:
    """The values, for one robot, of the words that signatures use for sizes, such as nv for the number of joint rates.

    rows_of_contacts  3 or 6 for each contact; left out: every named frame is a point, of 3 rows
    """

    n: int
    nq: int
    nv: int
    l: int
    frames: int
    nonzeros: int = 0
    rows_of_contacts: tuple[int, ...] = ()

    @property
    def contacts(self) -> int:
        return len(self.rows_of_contacts) or self.frames

    @property
    def contact_rows(self) -> int:
        return sum(self.rows_of_contacts) or 3 * self.frames

    @property
    def nx(self) -> int:
        """The number of entries of a small displacement of the state (q, qd), along the tangent of q."""
        return 2 * self.nv

    @staticmethod
    def of_chain(n: int, l: int, frames: int = 1) -> Sizes:
        """Return the sizes of a robot whose joints have one coordinate each."""
        return Sizes(n, n, n, l, frames)

    def shape(self, axes: Sequence[str]) -> tuple[int, ...]:
        """Lengths of axes as Quantity has them."""
        return tuple(map(self._length, axes))

    def _length(self, axis: str) -> int:
        if axis in WORDS:
            return int(getattr(self, axis))
        if axis.isdecimal():
            return int(axis)
        return sum(math.prod(map(self._length, part.split("*"))) for part in axis.split("+"))

    def size(self, quantity: Quantity) -> int:
        """Reals per state."""
        return math.prod(self.shape(quantity.axes))


@dataclass(frozen=True, slots=True)
class Quantity:
    """A named input or output of functions: a scalar (no axes), vector or matrix (row-major).

    axes     each a word of WORDS, a number, or sums of products of these: nv+frames*6
    largest  SI; tests draw an input between minus and plus this value, or from
    least    up to `largest`
    means    its description in Python's documentation, with the unit
    unit     SI unit that all entries have in common, such as 'kg m^2/s'; traces need it (lower/units.py)
    powers   for each axis, the power of its own units in the unit of an entry; left out: zero. nq and nv have the units of
             joint coordinates (rad or m), nx those of nv and then the same per second, l those of base parameters. The
             first three of 6, and of each contact's rows, are m, the others 1
    default  the value of all entries if Python's callers leave the input out
    whole    whether tests draw whole numbers only
    """

    name: str
    axes: tuple[str, ...] = ()
    largest: float = 1.0
    means: str = ""
    unit: str = ""
    powers: tuple[int, ...] = ()
    least: float | None = None
    default: float | None = None
    whole: bool = False

    def __post_init__(self) -> None:
        words = [word for axis in self.axes for part in axis.split("+") for word in part.split("*")]
        wrong = [word for word in words if word not in WORDS and not word.isdecimal()]
        if wrong or not self.name.isidentifier():
            raise ValueError(f"{self.name!r} with axes {self.axes}: an axis is a number or one of {WORDS}")
        if len(self.powers) not in (0, len(self.axes)):
            raise ValueError(f"{self.name!r} has {len(self.powers)} powers for {len(self.axes)} axes")

    @property
    def dimension(self) -> Dimension:
        """What all entries have in common."""
        return dimension_of(self.unit)

    def dimensions(self, axes: Mapping[str, Sequence[Dimension]]) -> list[Dimension]:
        """Return the dimension of each entry, row by row; `axes` gives the dimensions along each axis that is not a
        number."""
        found = [self.dimension]
        for axis, power in zip(self.axes, self.powers or (0,) * len(self.axes), strict=True):
            own = axes[axis] if axis in axes else [NUMBER] * int(axis)
            found = [times(each, along, power) for each in found for along in own]
        return found

    def drawn(self, shares: Any) -> Any:
        """Return values for tests from random numbers `shares` between -1 and 1."""
        if self.least is None:
            return self.largest * shares
        drawn = self.least + (self.largest - self.least) * (0.5 + 0.5 * shares)
        return (drawn + 0.5) // 1 if self.whole else drawn

    @property
    def is_matrix(self) -> bool:
        """Whether it is a matrix, packed or not. A matrix has many entries, so each is stored as soon as it is
        computed."""
        return len(self.axes) > 1 or "nonzeros" in self.axes


@dataclass(frozen=True, slots=True)
class Joined(Quantity):
    """Several quantities, one after the other."""

    parts: tuple[Quantity, ...] = ()

    def dimensions(self, axes: Mapping[str, Sequence[Dimension]]) -> list[Dimension]:
        return [each for part in self.parts for each in part.dimensions(axes)]


@dataclass(frozen=True, slots=True)
class Signature:
    """The name, inputs and outputs of one generated function, and how its code computes them.

    name      of the function; in C, the robot's name precedes it
    order     its place in headers, documents and lists: ascending
    meaning   its description in the header
    inputs    read, in this order
    outputs   written, in this order
    theta     whether a variant exists that takes theta_b (length l) at run time
    factorises  symmetric matrices, in the order of their pivots' numbers. The pivots are computed with the outputs: if one
              is not positive the function fails, its outputs are NaN and it returns which; none: it cannot fail
    products  matrix products that compute outputs from what a trace computes
    thin      outputs (nv, nv) that a trace with limbs computes as factors, without a product (thin_products.py)
    normalizes  whether quaternions that it reads may have any length but zero
    summary   a sentence on what it computes, for Python and the table of docs/functions.md
    calls     name of the function of states that its C code calls stage by stage; None: it calls no function
    spoilt    name of its outputs in sentences about failure, such as "accelerations"
    """

    name: str
    order: int
    meaning: str
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    theta: bool
    factorises: tuple[SymmetricMatrix, ...] = ()
    products: tuple[Product, ...] = ()
    thin: tuple[Thin, ...] = ()
    calls: str | None = None
    normalizes: bool = False
    summary: str = ""
    spoilt: str = "results"

    def __post_init__(self) -> None:
        names = [q.name for q in (*self.inputs, *self.stored)] + [product.right for product in self.products]
        if len(set(names)) != len(names):
            raise ValueError(f"{self.name}: a name stands for two of {', '.join(names)}")
        if not self.outputs:
            raise ValueError(f"{self.name}: a function has outputs")

    @property
    def stored(self) -> tuple[Quantity, ...]:
        """All quantities that the function's PROGRAMs store: outputs, then pivots."""
        return (*self.outputs, *((self.pivots,) if self.pivots else ()))

    @property
    def pivots(self) -> Quantity | None:
        """The pivots of all matrices that the function factorises, which must be positive; None if it factorises none."""
        parts = [Quantity(PIVOTS, each.axes, unit=each.unit, powers=each.powers) for each in self.factorises]
        if len(parts) < 2:
            return parts[0] if parts else None
        whole = "+".join("*".join(part.axes) for part in parts)
        return Joined(PIVOTS, (whole,), unit=parts[0].unit, parts=tuple(parts))

    @property
    def raises(self) -> bool:
        """Whether Python raises an error if one of its matrices is not positive definite."""
        return any(matrix.error for matrix in self.factorises)

    @property
    def pivot_numbers(self) -> tuple[str, ...]:
        """In words for each matrix, the number from 0 of a pivot that is not positive."""
        lengths = [f"{' '.join(matrix.axes)} + " for matrix in self.factorises]
        return tuple("".join(lengths[:k]) + matrix.number for k, matrix in enumerate(self.factorises))

    @property
    def traced(self) -> frozenset[str]:
        """Names of everything that the function's traces compute. If an output is a product, this is its right factor."""
        right = {product.output: product.right for product in self.products}
        return frozenset(right.get(quantity.name, quantity.name) for quantity in self.stored)

    @property
    def of_limbs(self) -> Signature:
        """What traces with limbs give."""
        if not self.thin:
            return self
        factors = Quantity(THIN, ("nv", "nv"), unit="1", powers=(1, -1))
        return replace(self, products=(), outputs=(*self.outputs, factors))

    def label(self, output: Quantity, theta: bool = False) -> str:
        """Return the name for one output's values: the function's name, followed by the output's name if there are
        several."""
        kernel = self.name + ("_theta" if theta else "")
        return kernel if len(self.outputs) == 1 else f"{kernel}_{output.name}"

    def sizes(self, sizes: Sizes) -> dict[str, int]:
        """Return the reals per state of all quantities that the function's PROGRAMs store, by name."""
        return {quantity.name: sizes.size(quantity) for quantity in self.stored}


def in_order(signatures: Sequence[Signature]) -> tuple[Signature, ...]:
    """Return the signatures sorted by `order`. Raises InternalError if two have the same order."""
    found = tuple(sorted(signatures, key=lambda signature: signature.order))
    for one, other in pairwise(found):
        if one.order == other.order:
            raise InternalError(f"{one.name} and {other.name} both have the order {one.order}")
    return found


PIVOTS = "pivot"
"""What the pivots and signs of a function's matrices are called in its traces."""

THIN = "thin"
"""What the factors are called that all of a function's thin products have in common."""

Q = Quantity(
    "q",
    ("nq",),
    math.pi,
    "joint positions: rad or m, or a unit quaternion for a ball joint or floating base",
    "1",
    (1,),
)
QD = Quantity("qd", ("nv",), 3.0, "joint rates, rad/s or m/s", "1/s", (1,))
QDD = Quantity("qdd", ("nv",), 5.0, "joint accelerations, rad/s^2 or m/s^2", "1/s^2", (1,))
TAU = Quantity(
    "tau", ("nv",), means="joint torques (N m), or forces (N) of sliding joints", unit="J", powers=(-1,)
)
"""Those of q, qd and qdd if states are drawn."""


def jacobian_of(output: str, by: str) -> Quantity:
    """Return the Quantity of the matrix (nv, nv) of derivatives of joint torques or accelerations, by another quantity
    with an entry per rate."""
    of_q = "q[j] (with a ball joint or floating base: for v[j] of a small displacement integrate(q, v))"
    entry = of_q if by == "q" else f"{by}[j]"
    known = {quantity.name: quantity for quantity in (Q, QD, QDD, TAU)}
    above, below = known.get(output, TAU), known[by]
    unit = str(times(above.dimension, below.dimension, -1))
    powers = (above.powers[0], -below.powers[0])
    means = f"derivatives of {output} by {by}: row i for {output}[i], column j for {entry}"
    return Quantity(f"d{output}_d{by}", ("nv", "nv"), means=means, unit=unit, powers=powers)
