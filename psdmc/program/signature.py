"""What a generated function reads and puts out: named quantities with sizes in words. Lowering computes what a
signature names, emission prints it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from psdmc.errors import InternalError
from psdmc.program.products import Product

WORDS = ("n", "nq", "nv", "nx", "l", "frames", "nonzeros")
"""Sizes that depend on the robot: joints, length of q, of qd, and of both together, base parameters, named frames; and, of
a function that packs a matrix, entries that it puts out."""


@dataclass(frozen=True, slots=True)
class Sizes:
    """What the words of a signature mean for one robot."""

    n: int
    nq: int
    nv: int
    l: int
    frames: int
    nonzeros: int = 0

    @property
    def nx(self) -> int:
        """Length of a small motion of the state (q, qd), along the tangent of q."""
        return 2 * self.nv

    @staticmethod
    def of_chain(n: int, l: int, frames: int = 1) -> Sizes:
        """The sizes of a robot whose joints have one coordinate each."""
        return Sizes(n, n, n, l, frames)

    def shape(self, axes: Sequence[str]) -> tuple[int, ...]:
        """Lengths of axes that are each a word of WORDS or a number."""
        return tuple(getattr(self, axis) if axis in WORDS else int(axis) for axis in axes)

    def size(self, quantity: Quantity) -> int:
        """Reals per state."""
        return math.prod(self.shape(quantity.axes))


@dataclass(frozen=True, slots=True)
class Quantity:
    """A named scalar (no axes), vector or matrix (row-major).

    axes     each a word of WORDS or a number
    largest  SI; tests draw an input from plus or minus this
    means    what Python's documentation says of it, with the unit
    """

    name: str
    axes: tuple[str, ...] = ()
    largest: float = 1.0
    means: str = ""

    def __post_init__(self) -> None:
        wrong = [axis for axis in self.axes if axis not in WORDS and not axis.isdecimal()]
        if wrong or not self.name.isidentifier():
            raise ValueError(f"{self.name!r} with axes {self.axes}: an axis is a number or one of {WORDS}")

    @property
    def is_matrix(self) -> bool:
        """Whether it is a matrix, packed or not: many entries, which are stored as they are computed."""
        return len(self.axes) > 1 or "nonzeros" in self.axes


@dataclass(frozen=True, slots=True)
class Positive:
    """Intermediate results that must be positive, entry by entry, for the function to have a result.

    which   says in words which entry is not positive, and what that means
    spoilt  says which outputs become NaN then
    """

    quantity: Quantity
    which: str
    spoilt: str


@dataclass(frozen=True, slots=True)
class Signature:
    """One generated function.

    name      of the function, in C behind the robot's name
    order     its place in headers, documents and lists: ascending
    meaning   what a user reads in the header
    inputs    read, in this order
    outputs   written, in this order
    theta     whether a variant exists that takes theta_b (length l) at run time
    positive  computed beside the outputs and not put out: where an entry is not above zero the function fails, its outputs
              are NaN and it returns which; None: it cannot fail
    products  how outputs that a trace does not give follow from what it gives
    normalizes  whether quaternions that it reads may have any length but zero
    summary   a sentence on what it computes, for Python and the table of docs/functions.md
    calls     name of a function of states that its C calls stage by stage, instead of a body of its own
    """

    name: str
    order: int
    meaning: str
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    theta: bool
    positive: Positive | None = None
    products: tuple[Product, ...] = ()
    calls: str | None = None
    normalizes: bool = False
    summary: str = ""

    def __post_init__(self) -> None:
        names = [q.name for q in (*self.inputs, *self.stored)] + [product.right for product in self.products]
        if len(set(names)) != len(names):
            raise ValueError(f"{self.name}: a name stands for two of {', '.join(names)}")
        if not self.outputs:
            raise ValueError(f"{self.name}: a function has outputs")

    @property
    def stored(self) -> tuple[Quantity, ...]:
        """All quantities that its PROGRAMs put out: outputs, then those that must be positive."""
        return (*self.outputs, *((self.positive.quantity,) if self.positive else ()))

    @property
    def traced(self) -> frozenset[str]:
        """Names of everything that its traces give: right factors in the place of products."""
        right = {product.output: product.right for product in self.products}
        return frozenset(right.get(quantity.name, quantity.name) for quantity in self.stored)

    def label(self, output: Quantity, theta: bool = False) -> str:
        """The name for one output's values: the function's, followed by the output's where there are several."""
        kernel = self.name + ("_theta" if theta else "")
        return kernel if len(self.outputs) == 1 else f"{kernel}_{output.name}"

    def sizes(self, sizes: Sizes) -> dict[str, int]:
        """Reals per state of all quantities that its PROGRAMs put out."""
        return {quantity.name: sizes.size(quantity) for quantity in self.stored}


def in_order(signatures: Sequence[Signature]) -> tuple[Signature, ...]:
    """By `order`; InternalError where two have the same."""
    found = tuple(sorted(signatures, key=lambda signature: signature.order))
    for one, other in pairwise(found):
        if one.order == other.order:
            raise InternalError(f"{one.name} and {other.name} both have the order {one.order}")
    return found


Q = Quantity(
    "q", ("nq",), math.pi, "joint positions: rad or m, or a unit quaternion for a ball joint or floating base"
)
QD = Quantity("qd", ("nv",), 3.0, "joint rates, rad/s or m/s")
QDD = Quantity("qdd", ("nv",), 5.0, "joint accelerations, rad/s^2 or m/s^2")
TAU = Quantity("tau", ("nv",), means="joint torques (N m), or forces (N) of sliding joints")
"""Those of q, qd and qdd if states are drawn."""


def jacobian_of(output: str, by: str) -> Quantity:
    """The matrix (nv, nv) of derivatives of joint torques or accelerations by another quantity with an entry per rate."""
    entry = "q along joint rate j (of q[j], if every joint has one coordinate)" if by == "q" else f"{by}[j]"
    means = f"derivatives of {output} by {by}: row i for {output}[i], column j for a change of {entry}"
    return Quantity(f"d{output}_d{by}", ("nv", "nv"), means=means)
