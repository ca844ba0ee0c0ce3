"""The inputs and outputs of a generated function. Each has a name, a unit and a shape given in words, such as nv for
the number of joint rates. A signature also names the symmetric matrices that the function factorises."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import Any, Protocol

from psdmc.errors import InternalError
from psdmc.program.dimensions import NUMBER, Dimension, dimension_of, times
from psdmc.program.products import Product, Thin

OF_ROWS = ("contact_rows", "loop_rows", "constraint_rows")
"""Rows of all contacts, of all loops, and of contacts and loops."""

WORDS = (
    *("n", "nq", "nv", "nx", "nxa", "nxu", "l", "frames", "contacts", "constraints"),
    *OF_ROWS,
    "nonzeros",
)
"""Sizes that depend on the robot: joints, length of q, of qd, of both together, and of these with qdd and with tau, base
parameters, named frames, contacts, contacts and closed loops, and their rows; and, of a function that packs a matrix,
entries that it puts out."""


class RobotSizes(Protocol):
    """Describes the sizes of a robot, which `psdmc.robot.mechanism.Mechanism` has."""

    @property
    def own_joints(self) -> Sequence[int]: ...
    @property
    def nq(self) -> int: ...
    @property
    def nv(self) -> int: ...
    @property
    def frames(self) -> Sequence[object]: ...
    @property
    def rows_of_contacts(self) -> tuple[int, ...]: ...
    @property
    def rows_of_loops(self) -> tuple[tuple[int, ...], ...]: ...


@dataclass(frozen=True, slots=True)
class Sizes:
    """The sizes of one robot: numbers of joints, of coordinates, of rates, of base parameters, of frames and so on.
    Shapes use their names as words, such as nv for the number of joint rates.

    rows_of_contacts  3 or 6 for each contact; left out: every named frame is a point, of 3 rows
    rows_of_loops     for each closed loop, the axes that it closes
    """

    n: int
    nq: int
    nv: int
    l: int
    frames: int
    nonzeros: int = 0
    rows_of_contacts: tuple[int, ...] = ()
    rows_of_loops: tuple[tuple[int, ...], ...] = ()

    @property
    def contacts(self) -> int:
        return len(self.rows_of_contacts) or self.frames

    @property
    def contact_rows(self) -> int:
        return sum(self.rows_of_contacts) or 3 * self.frames

    @property
    def loop_rows(self) -> int:
        return sum(map(len, self.rows_of_loops))

    @property
    def constraints(self) -> int:
        return self.contacts + len(self.rows_of_loops)

    @property
    def constraint_rows(self) -> int:
        return self.contact_rows + self.loop_rows

    @property
    def nx(self) -> int:
        """Return 2 nv, the number of entries of a small change of the state: nv for the change of q, nv for that of qd.
        A quaternion counts as three rotations."""
        return 2 * self.nv

    @property
    def nxa(self) -> int:
        """The number of entries of a small displacement of (q, qd, qdd), along the tangent of q."""
        return 3 * self.nv

    @property
    def nxu(self) -> int:
        """The number of entries of a small displacement of (q, qd, tau), along the tangent of q."""
        return 3 * self.nv

    @staticmethod
    def of(robot: RobotSizes, l: int = 0, nonzeros: int = 0) -> Sizes:
        """Return the sizes of a robot (Mechanism) with l base parameters, for a function that packs a matrix into
        `nonzeros` entries."""
        return Sizes(
            len(robot.own_joints),
            robot.nq,
            robot.nv,
            l,
            len(robot.frames),
            nonzeros,
            robot.rows_of_contacts,
            robot.rows_of_loops,
        )

    @staticmethod
    def of_chain(n: int, l: int, frames: int = 1) -> Sizes:
        """Return the sizes of a robot with n joints of one coordinate each, l base parameters and some named frames."""
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

    axes     length of each axis: a word of WORDS (sizes of the robot), a number, or a sum of products such as
             nv+frames*6
    largest  largest test value, SI; tests draw an input between minus and plus this value, or from
    least    up to `largest`
    means    its description in Python's documentation, with the unit
    unit     SI unit that all entries have in common, such as 'kg m^2/s'; the code generator checks units
             (lower/factored.py)
    powers   for each axis, the power to which the unit of the row or column multiplies `unit`; left out: zero. This
             unit is rad or m along nq and nv, by the joint. Along nx it is that of nv, then that of nv per second.
             Along nxa and nxu it is that of nx, then that of qdd or tau.
             Along l it is that of the base parameter. Along 6, and the rows of a contact, it is m for the first three,
             then 1
    default  the value of all entries if Python's callers leave the input out
    whole    whether only `least` and `largest` are allowed, such as 0 and 1
    allowed  the smallest and the largest value that are allowed; None: all are
    by_q     whether entries are derivatives by q
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
    allowed: tuple[float, float] | None = None
    by_q: bool = False

    def __post_init__(self) -> None:
        words = [word for axis in self.axes for part in axis.split("+") for word in part.split("*")]
        wrong = [word for word in words if word not in WORDS and not word.isdecimal()]
        if wrong or not self.name.isidentifier():
            raise ValueError(f"{self.name!r} with axes {self.axes}: an axis is a number or one of {WORDS}")
        if len(self.powers) not in (0, len(self.axes)):
            raise ValueError(f"{self.name!r} has {len(self.powers)} powers for {len(self.axes)} axes")

    @property
    def dimension(self) -> Dimension:
        """Return the dimension that all entries have in common."""
        return dimension_of(self.unit)

    def dimensions(self, axes: Mapping[str, Sequence[Dimension]]) -> list[Dimension]:
        """Return the physical dimension of each entry of this quantity, row by row. `axes` gives the dimensions along
        each axis that the robot determines, such as nv."""
        found = [self.dimension]
        for axis, power in zip(self.axes, self.powers or (0,) * len(self.axes), strict=True):
            own = axes[axis] if axis in axes else [NUMBER] * int(axis)
            found = [times(each, along, power) for each in found for along in own]
        return found

    def drawn(self, shares: Any) -> Any:
        """Return test values of this quantity, from random numbers `shares` between -1 and 1."""
        if self.least is None:
            return self.largest * shares
        drawn = self.least + (self.largest - self.least) * (0.5 + 0.5 * shares)
        return (drawn + 0.5) // 1 if self.whole else drawn

    def fault(self, values: Sequence[float]) -> tuple[int, str] | None:
        """Return the index of the first value that is not allowed, and words for what is expected; None if all are."""
        for k, value in enumerate(values):
            if self.whole and value not in (self.least, self.largest):
                return k, f"{self.least:g} or {self.largest:g}"
            if self.allowed is not None and not self.allowed[0] <= value <= self.allowed[1]:
                low, high = self.allowed
                return k, f"{low:g} to {high:g}" if high < math.inf else f"{low:g} or more"
        return None

    @property
    def is_matrix(self) -> bool:
        """Return whether this quantity is a matrix, also one stored as the vector of its nonzero entries. A matrix has
        many entries, so each is stored as soon as it is computed."""
        return len(self.axes) > 1 or "nonzeros" in self.axes


@dataclass(frozen=True, slots=True)
class Joined(Quantity):
    """Several quantities, one after the other."""

    parts: tuple[Quantity, ...] = ()

    def dimensions(self, axes: Mapping[str, Sequence[Dimension]]) -> list[Dimension]:
        return [each for part in self.parts for each in part.dimensions(axes)]


class Structure(StrEnum):
    """The entries of a symmetric matrix that are zero at every state.

    DENSE   no entry is zero at every state
    LIMBS   branches (limbs) on a common body: the entry of two joints is zero if neither joint carries the other.
            Elimination from the last row up keeps these zeros (Featherstone 2008, section 6.5)
    BLOCKS  square blocks on the diagonal, each factorised separately; the other entries are zero
    """

    DENSE = "dense"
    LIMBS = "limbs on a core"
    BLOCKS = "blocks"


@dataclass(frozen=True, slots=True)
class SymmetricMatrix:
    """A symmetric matrix that a function factorises. If the matrix is not positive definite, the function has no
    result.

    A matrix A = L^T D L is positive definite if all pivots, the entries of D, are positive. If one is not, the generated
    C function returns the number of the first such pivot, from 1. Python gives NaN or an error.

    name       the matrix's name in sentences
    structure  which entries are zero
    axes       shape of the array of pivots, in words such as nv; for blocks, that of the array with one sign per block
    number     words for the number, from 0, of the pivot or sign that is not positive; C returns this number plus 1
    failure    the reason, in Python's documentation: words that follow "if "; several reasons are one line each
    unit       unit of the pivots
    powers     how the unit depends on the axes, as in Quantity
    error      one line that Python raises as an error; {axis} stands for the name of an entry of that axis (such as
               {frames}), and {input} for a scalar input. Empty: the results of such a state are NaN
    hint       the remedy that is printed with the error
    """

    name: str
    structure: Structure
    axes: tuple[str, ...]
    number: str
    failure: str
    error: str = ""
    hint: str = ""
    unit: str = "1"
    powers: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if not self.axes or (len(self.axes) > 1 and self.structure is not Structure.BLOCKS):
            raise ValueError(f"{self.name}: {self.structure} with axes {self.axes}")

    def in_blocks(self, count: str, number: str, failure: str) -> SymmetricMatrix:
        """Return the block-diagonal matrix whose blocks are several matrices like this one.

        count            name of the number of blocks
        number, failure  as in SymmetricMatrix, for the new matrix
        """
        return replace(
            self,
            structure=Structure.BLOCKS,
            axes=(count, *self.axes),
            powers=(0, *self.powers) if self.powers else (),
            number=number,
            failure=failure,
        )


@dataclass(frozen=True, slots=True)
class Signature:
    """The name, inputs and outputs of one generated function, and how its code computes them.

    name      of the function; in C, the robot's name precedes it
    order     its place in headers, documents and lists: ascending
    meaning   its description in the header
    inputs    read, in this order
    outputs   written, in this order
    theta     whether a variant exists that takes the base parameters (theta_b, length l) at run time
    factorises  symmetric matrices that the function factorises, in order. The divisors (pivots) must be positive. If
                one is not, the outputs are NaN and the function returns its number; none: the function cannot fail
    stages    how often the code factorises these matrices, one time after the other
    products  matrix products that compute outputs after the traced arithmetic, in C loops
    thin      matrices that are computed as factors if a robot has equal limbs, such as legs, and multiplied
              last (products.py)
    normalizes  whether quaternions in q may have any length but zero
    summary   one or two sentences on what it computes, for Python and the table of docs/functions.md
    calls     names of the functions that the C code calls, such as one for each stage of an integration step
    spoilt    name of its outputs in sentences about failure, such as "accelerations"
    weighs    whether the function depends on gravity although it has no motor torques
    """

    name: str
    order: int
    meaning: str
    inputs: tuple[Quantity, ...]
    outputs: tuple[Quantity, ...]
    theta: bool
    factorises: tuple[SymmetricMatrix, ...] = ()
    stages: int = 1
    products: tuple[Product, ...] = ()
    thin: tuple[Thin, ...] = ()
    calls: tuple[str, ...] = ()
    normalizes: bool = False
    summary: str = ""
    spoilt: str = "results"
    weighs: bool = False

    def __post_init__(self) -> None:
        names = [q.name for q in (*self.inputs, *self.stored)] + [product.right for product in self.products]
        if len(set(names)) != len(names):
            raise ValueError(f"{self.name}: a name stands for two of {', '.join(names)}")
        if not self.outputs:
            raise ValueError(f"{self.name}: a function has outputs")

    @property
    def has_motor_torques(self) -> bool:
        """Return whether the function depends on motor torques at rates qd, or on the motion from which they follow. Then
        joint friction can be a part of the function."""
        names = {quantity.name for quantity in self.inputs}
        return self.theta and QD.name in names and bool({TAU.name, QDD.name} & names)

    @property
    def depends_on_gravity(self) -> bool:
        """Return whether the results depend on gravity."""
        return self.weighs or self.has_motor_torques

    @property
    def stored(self) -> tuple[Quantity, ...]:
        """Return all quantities that the function's PROGRAMs store: outputs, then pivots."""
        return (*self.outputs, *((self.pivots,) if self.pivots else ()))

    @property
    def pivots(self) -> Quantity | None:
        """Return the description of the pivots, the divisors in matrix factorisations, which must be positive. Return
        None if the function factorises no matrix."""
        matrices = self.factorises * self.stages
        parts = [Quantity(PIVOTS, each.axes, unit=each.unit, powers=each.powers) for each in matrices]
        if len(parts) < 2:
            return parts[0] if parts else None
        whole = "+".join("*".join(part.axes) for part in parts)
        return Joined(PIVOTS, (whole,), unit=parts[0].unit, parts=tuple(parts))

    @property
    def note(self) -> str:
        """Return a paragraph that explains derivatives by q, if an output contains any; else nothing."""
        return BY_Q if any(quantity.by_q for quantity in self.outputs) else ""

    @property
    def raises(self) -> bool:
        """Return whether a Python call raises an error if a factorised matrix is not positive definite."""
        return any(matrix.error for matrix in self.factorises)

    @property
    def pivot_numbers(self) -> tuple[str, ...]:
        """Return for each factorised matrix a phrase that says which pivot (divisor of the factorisation) is not
        positive. Pivots are numbered from 0 over all matrices."""
        lengths = [" ".join(matrix.axes) for matrix in self.factorises]
        later = f", + ({' + '.join(lengths)}) times the stage of the step" if self.stages > 1 else ""
        later = later.replace("constraints", "contacts")  # closed loops count as contacts there
        return tuple(
            "".join(f"{length} + " for length in lengths[:k]) + matrix.number + later
            for k, matrix in enumerate(self.factorises)
        )

    @property
    def traced(self) -> frozenset[str]:
        """Return the names of all quantities that the function's recorded arithmetic computes. If an output is a matrix
        product, its right factor is listed in its place."""
        right = {product.output: product.right for product in self.products}
        return frozenset(right.get(quantity.name, quantity.name) for quantity in self.stored)

    @property
    def of_limbs(self) -> Signature:
        """Return the signature of traces with limbs."""
        if not self.thin:
            return self
        factors = Quantity(THIN, ("nv", "nv"), unit="1", powers=(1, -1))
        if any(each.below for each in self.thin):
            below = Quantity(THIN, ("contact_rows", "nv"), unit="J s^2", powers=(-1, -1))
            factors = Joined(THIN, ("nv+contact_rows", "nv"), parts=(factors, below))
        return replace(self, products=(), outputs=(*self.outputs, factors))

    def label(self, output: Quantity, theta: bool = False) -> str:
        """Return the name of one output's values in files and messages: the function's name. If the function has
        several outputs, the output's name follows."""
        kernel = self.name + ("_theta" if theta else "")
        return kernel if len(self.outputs) == 1 else f"{kernel}_{output.name}"

    def sizes(self, sizes: Sizes) -> dict[str, int]:
        """Return the number of scalars in each quantity that the function's PROGRAMs (lists of operations to generate)
        store, by the quantity's name. The numbers are for one state."""
        return {quantity.name: sizes.size(quantity) for quantity in self.stored}


def in_order(signatures: Sequence[Signature]) -> tuple[Signature, ...]:
    """Return signatures in the order of their numbers `order`. Raises InternalError if two are equal."""
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
    "joint positions, rad or m; a ball joint or floating base has a unit quaternion (x, y, z, w)",
    "1",
    (1,),
)
Q_GUESS = replace(
    Q,
    name="q_guess",
    means="joint positions, rad or m, of which those of passive joints are a guess; a ball joint or floating base has a "
    "unit quaternion (x, y, z, w)",
)
QD = Quantity("qd", ("nv",), 3.0, "joint rates, rad/s or m/s", "1/s", (1,))
QDD = Quantity("qdd", ("nv",), 5.0, "joint accelerations, rad/s^2 or m/s^2", "1/s^2", (1,))
TAU = Quantity(
    "tau", ("nv",), means="joint torques (N m), or forces (N) of sliding joints", unit="J", powers=(-1,)
)
"""Those of q, qd and qdd if states are drawn; those of q_guess are drawn near closed loops (near_closed)."""

BY_Q = (
    "If the robot has a ball joint or a floating base, q contains a quaternion and has more than nv entries. The "
    "derivatives by q are then derivatives by the nv entries x[j] of a small displacement x, at x = 0. The displaced q "
    "is integrate(q, x). For a joint with one coordinate, x[j] is the change of its position. For a ball joint, x has "
    "three rotations about the axes of the moving body. For a floating base, x has three linear displacements along the "
    "base's axes, then three rotations about these axes."
)
"""Explains derivatives by q."""


def jacobian_of(output: str, by: str) -> Quantity:
    """Return the description (Quantity) of a matrix (nv, nv) of derivatives. `output`, such as joint torques, is
    differentiated by `by`, such as joint rates; nv is the number of joint rates."""
    known = {quantity.name: quantity for quantity in (Q, QD, QDD, TAU)}
    return derivative_of(replace(known.get(output, TAU), name=output), known[by])


def derivative_of(above: Quantity, below: Quantity) -> Quantity:
    """Return the Quantity of the derivatives of one quantity by another. Its axes are those of the first, then those of
    the second, or nv if the second is q."""
    axes = ("nv",) if below.axes == Q.axes else below.axes
    row, column = "i" if len(above.axes) == 1 else "k, i", "j" if len(axes) == 1 else "k, m"
    return Quantity(
        f"d{above.name}_d{below.name}",
        (*above.axes, *axes),
        means=f"derivatives of {above.name} by {below.name}: entry [{row}, {column}] is the derivative of "
        f"{above.name}[{row}] by {below.name}[{column}]",
        unit=str(times(above.dimension, below.dimension, -1)),
        powers=(*_powers(above), *(-power for power in _powers(below))),
        by_q=below.name == Q.name,
    )


def _powers(quantity: Quantity) -> tuple[int, ...]:
    return quantity.powers or (0,) * len(quantity.axes)
