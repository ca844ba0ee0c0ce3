"""Eliminates symmetric matrices block by block, for robots with equal limbs (such as legs) on a core (such as a trunk).

The operations are written for one limb of each group of equal limbs, and hold for all limbs of the group. Entries of
the matrix that belong to two different limbs are zero. With the rows l of a limb and c of the core, the following
matrices give the solution.

    Q = M_ll^-1        T = Q M_lc        V = (M_cc - sum over all limbs of M_cl T)^-1

M x = y is solved by x_c = V (y_c - sum T^T y_l) and x_l = Q y_l - T x_c. Nothing else is summed over limbs. The pivots
are those of an elimination row by row from the last one up (solve.py).

With contacts on limbs, the motion x and the contact forces f solve M x - J^T f = load and J x + shift f = wanted. With
g = -f, the matrix of these equations is symmetric. The forces on a limb are further rows of the limb. With M and J in
the rows l of one limb, elimination of its rates and then of its forces needs no larger matrix than

    D = J_l M_ll^-1 J_l^T + shift

Only a matrix with the rows of the core is a sum over limbs. This elimination loses digits if D is much smaller than
J M^-1 J^T + shift, as at a straight knee.

Source: Featherstone 2008, sections 6.5 and 8."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice

from psdmc.dynamics.constraints import pushed_slopes
from psdmc.dynamics.coordinates import first_rates, positions
from psdmc.dynamics.frames import (
    BASE,
    Frame,
    from_previous,
    has_floating_base,
    inward,
    joint_turn,
    outward,
    to_previous,
)
from psdmc.dynamics.kinematics import AT_BASE, Root
from psdmc.dynamics.scalar import Matrix as Axes
from psdmc.dynamics.scalar import Scalar, Vector, transform, transpose
from psdmc.dynamics.solve import Factors, SingularMatrix, factorize, inner_product, inverse, is_zero, solve
from psdmc.robot.mechanism import NamedFrame

Matrix = Sequence[Sequence[Scalar]]

SMALL = 6
"""Rates of a floating base."""

LEAST_SHARE = 1e-3
"""The least share of its diagonal entry that a pivot of D must have."""


@dataclass(frozen=True, slots=True)
class Limb:
    """One limb (such as a leg) of a group of equal limbs, after elimination of its rows of a symmetric matrix M.

    rates     indices of the limb's joint rates, which are its rows of M
    carriers  indices of rows of the core (the rest of the robot) that have entries in common with the limb
    total     function that returns the sum of a scalar over the limbs of the group
    factors   factors of the limb's diagonal block M_ll
    shares    T = M_ll^-1 M_lc, with the limb's entries M_lc in columns of the core: a row per rate, a column per
              carrier
    """

    rates: tuple[int, ...]
    carriers: tuple[int, ...]
    total: Callable[[Scalar], Scalar]
    factors: Factors
    shares: Matrix

    def reduced(self, right: Sequence[Scalar]) -> list[Scalar]:
        """Eliminate the rows of one limb (such as a leg) from a right side y of M x = y, and return the result.

        With the symbols of the module, rows of the core become y_c - T^T y_l, and rows of the limb become Q y_l.

        right  y, whose entries in rows of other limbs are zero
        """
        own, found = [right[k] for k in self.rates], list(right)
        for k, column in zip(self.carriers, zip(*self.shares, strict=True), strict=True):
            found[k] = found[k] - inner_product(column, own)
        for k, value in zip(self.rates, solve(self.factors, own), strict=True):
            found[k] = value
        return found


@dataclass(frozen=True, slots=True)
class Arrow:
    """A symmetric matrix M of a robot with equal limbs (such as legs) on a core (such as a trunk), after elimination.

    core     indices of the core's rows
    limbs    one limb of each group of equal limbs
    factors  factors of the core's block minus what elimination of the limbs subtracts from it
    pivots   pivots of all rows
    """

    core: tuple[int, ...]
    limbs: tuple[Limb, ...]
    factors: Factors
    pivots: tuple[Scalar, ...]

    def solved(
        self, right: Sequence[Scalar], matrix: Matrix | None = None, vector: Sequence[Scalar] = ()
    ) -> list[Scalar]:
        """Solve M x = right or, if `matrix` is given, M x = right - matrix vector, and return x.

        Entries of `matrix` that belong to two different limbs (such as legs) must be zero.
        """
        found = self._reduced(right) if matrix is None else self._reduced_by(right, matrix, vector)
        above = [found[k] for k in self.core]
        for k, value in zip(self.core, solve(self.factors, above), strict=True):
            found[k] = value
        for limb in self.limbs:
            given = [found[k] for k in limb.carriers]
            for k, shares in zip(limb.rates, limb.shares, strict=True):
                found[k] = found[k] - inner_product(shares, given)
        return found

    def _reduced(self, right: Sequence[Scalar]) -> list[Scalar]:
        """y_c - sum T^T y_l and Q y_l, of a right side that is the core's in the rows of the core."""
        return self._summed(list(right), [limb.reduced(self._alone(limb, right)) for limb in self.limbs])

    def _reduced_by(self, right: Sequence[Scalar], matrix: Matrix, vector: Sequence[Scalar]) -> list[Scalar]:
        """Return what `_reduced` returns of right - matrix vector. What a limb's columns give to the core is summed
        together with T^T y_l."""
        found, reduced = list(right), []
        for k in self.core:
            found[k] = found[k] - _product(matrix[k], vector, self.core)
        for limb in self.limbs:
            own = self._alone(limb, right)
            for k in limb.rates:
                own[k] = own[k] - _product(matrix[k], vector, (*self.core, *limb.rates))
            for k in self.core:
                own[k] = -_product(matrix[k], vector, limb.rates)
            reduced.append(limb.reduced(own))
        return self._summed(found, reduced)

    def _alone(self, limb: Limb, right: Sequence[Scalar]) -> list[Scalar]:
        """A right side that is zero in all rows but a limb's."""
        return [value if k in limb.rates else 0.0 for k, value in enumerate(right)]

    def _summed(self, found: list[Scalar], reduced: Sequence[Sequence[Scalar]]) -> list[Scalar]:
        """The core's rows with the sums of what limbs add to them, and limbs' own rows."""
        for limb, own in zip(self.limbs, reduced, strict=True):
            for k in self.core:
                found[k] = found[k] + limb.total(own[k])
            for k in limb.rates:
                found[k] = own[k]
        return found

    def thin(
        self, matrix: Matrix, owners: Sequence[int] | None = None, is_solved: bool = False
    ) -> list[list[Scalar]]:
        """Return two factors of -M^-1 D in one matrix: E in the rows of the core, and Y in those of limbs (such as
        legs).

        For a column of E and Y, -M^-1 D is x = -V E in rows of the core, and Y - T x in rows of a limb. The module
        defines V and T. Y is zero in columns of other limbs. Entries of D that belong to two different limbs must be
        zero. With `is_solved`, the rows of the core are x instead of E, and columns of the core are those of -M^-1 D.

        owners  for each column of D, the row of M that belongs to the same joint or contact; None: the row of its number
        """
        columns = [list(column) for column in zip(*matrix, strict=True)]
        limb_of = {k: limb for limb in self.limbs for k in limb.rates}
        found = [
            limb_of[k].reduced(column) if k in limb_of else self._reduced(column)
            for k, column in zip(owners or range(len(columns)), columns, strict=True)
        ]
        rows = [list(row) for row in zip(*found, strict=True)]
        rows = [row if k in self.core else [-value for value in row] for k, row in enumerate(rows)]
        return self._solved(rows, owners or range(len(columns))) if is_solved else rows

    def _solved(self, rows: list[list[Scalar]], owners: Sequence[int]) -> list[list[Scalar]]:
        """Replace E by x = -V E and, in columns of the core, Y by Y - T x."""
        right = list(zip(*(rows[k] for k in self.core), strict=True))
        for k, weights in zip(self.core, inverse(self.factors), strict=True):
            rows[k] = [-inner_product(weights, column) for column in right]
        own = [column for column, owner in enumerate(owners) if owner in self.core]
        for limb in self.limbs:
            for k, shares in zip(limb.rates, limb.shares, strict=True):
                for column in own:
                    product = inner_product(shares, [rows[c][column] for c in limb.carriers])
                    rows[k][column] = rows[k][column] - product
        return rows

    def thin_inverse(self, is_solved: bool = False) -> list[list[Scalar]]:
        """The factors of M^-1 itself."""
        n = len(self.pivots)
        unit = [[-1.0 if i == j else 0.0 for j in range(n)] for i in range(n)]
        return self.thin(unit, is_solved=is_solved)

    @property
    def has_small_core(self) -> bool:
        """Whether the core is a floating base alone. Its rows of -M^-1 D are then written out in straight lines (`thin`
        with `is_solved`). For larger cores, these lines would be longer than the code of limbs."""
        return self.core == tuple(range(SMALL))

    def thin_factors(self, is_solved: bool = False) -> list[list[Scalar]]:
        """Return two factors of M^-1 in one matrix: V in the rows of the core, and T in those of limbs such as legs.

        Both have the columns of the core, and are defined in the module. With `is_solved`, V is left out.
        """
        n = len(self.pivots)
        found: list[list[Scalar]] = [[0.0] * n for _ in range(n)]
        for k, row in zip(self.core, () if is_solved else inverse(self.factors), strict=not is_solved):
            for j, value in zip(self.core, row, strict=True):
                found[k][j] = value
        for limb in self.limbs:
            for k, shares in zip(limb.rates, limb.shares, strict=True):
                for j, value in zip(limb.carriers, shares, strict=True):
                    found[k][j] = value
        return found


def eliminated(frames: Sequence[Frame], matrix: Matrix, further: Sequence[Sequence[int]] = ()) -> Arrow:
    """Factorize a symmetric matrix M with one row per joint rate, such as the mass matrix, limb by limb.

    A limb is a branch of the robot that equals other branches, such as a leg. Raises SingularMatrix if a pivot is a
    constant that is not positive.

    further  for each group of limbs, indices of rows that M has besides those of joint rates, such as those of contact
             forces on a limb. They are eliminated after the limb's rates
    """
    core, groups = limbs_of(frames)
    if further:
        groups = [((*own, *rates), total) for own, (rates, total) in zip(further, groups, strict=True)]
    rest = {(i, j): matrix[i][j] for i in core for j in core if j <= i}
    pivots: list[Scalar] = [0.0] * len(matrix)
    limbs = [_eliminated(rates, total, core, matrix) for rates, total in groups]
    for limb in limbs:
        for i, row in zip(limb.carriers, _lower(limb, matrix), strict=True):
            for j, value in zip(limb.carriers, row, strict=False):
                rest[i, j] = rest[i, j] - limb.total(value)
        for k, pivot in zip(limb.rates, limb.factors.pivots, strict=True):
            pivots[k] = pivot
    factors = _factorized(core, [[rest[max(i, j), min(i, j)] for j in core] for i in core])
    for k, pivot in zip(core, factors.pivots, strict=True):
        pivots[k] = pivot
    return Arrow(core, tuple(limbs), factors, tuple(pivots))


def _lower(limb: Limb, matrix: Matrix) -> list[list[Scalar]]:
    """M_cl T of one limb, its lower triangle."""
    columns = list(zip(*limb.shares, strict=True))
    return [
        [inner_product([matrix[i][k] for k in limb.rates], column) for column in columns[: number + 1]]
        for number, i in enumerate(limb.carriers)
    ]


def _eliminated(
    rates: tuple[int, ...], total: Callable[[Scalar], Scalar], core: Sequence[int], matrix: Matrix
) -> Limb:
    factors = _factorized(rates, [[matrix[i][j] for j in rates] for i in rates])
    carriers = tuple(c for c in core if any(not is_zero(matrix[k][c]) for k in rates))
    columns = [solve(factors, [matrix[k][c] for k in rates]) for c in carriers]
    shares = [[column[k] for column in columns] for k in range(len(rates))]
    return Limb(rates, carriers, total, factors, shares)


def _factorized(rates: Sequence[int], block: Matrix) -> Factors:
    try:
        return factorize(block)
    except SingularMatrix as singular:
        raise SingularMatrix(rates[singular.row]) from None


def _product(row: Sequence[Scalar], vector: Sequence[Scalar], where: Sequence[int]) -> Scalar:
    """A part of a row times a vector."""
    return inner_product([row[k] for k in where], [vector[k] for k in where])


def any_limbs(frames: Sequence[Frame]) -> bool:
    """Return whether some frames stand for several equal limbs, such as legs, in equations written for one limb only."""
    return any(frame.limbs is not None for frame in frames)


def limbs_of(
    frames: Sequence[Frame],
) -> tuple[tuple[int, ...], list[tuple[tuple[int, ...], Callable[[Scalar], Scalar]]]]:
    """Return the joint rates of the core, and those of one limb of each group of equal limbs, such as legs.

    The core is the rest of the robot. For each limb, the function that sums a scalar over the limbs of the group is
    also returned.
    """
    roots: list[int] = []
    for i, frame in enumerate(frames):
        above = BASE if frame.parent == BASE else roots[frame.parent]
        roots.append(i if frame.limbs is not None else above)
    owners = [root for root, frame in zip(roots, frames, strict=True) if frame.mimic is None]
    first = first_rates(frames)
    own: dict[int, list[int]] = {}
    for number, root in enumerate(owners):
        own.setdefault(root, []).extend(range(first[number], first[number + 1]))
    core = tuple(own.pop(BASE, ()))
    return core, [(tuple(rates), frames[root].limbs) for root, rates in own.items()]  # type: ignore[misc]


def eliminated_with_forces(
    frames: Sequence[Frame],
    mass: Matrix,
    jacobian: Matrix,
    active: Sequence[Scalar],
    shift: Sequence[Scalar],
    one: Sequence[Scalar],
) -> tuple[Arrow, list[Scalar]]:
    """Eliminate the equations of a robot with contacts on equal limbs. Return a number for each row of the contact
    Jacobian, too, which is positive if the elimination keeps its digits.

    The elimination has a row per joint rate, and then a row for -f per row of J. The other arguments are those of
    `constrained` (constraints.py). A contact that is not active has no force.
    """
    first = len(mass)
    held = [[on * entry for entry in row] for on, row in zip(active, jacobian, strict=True)]
    core, groups = limbs_of(frames)
    own = [
        [k for k, row in enumerate(jacobian) if any(not is_zero(row[rate]) for rate in rates)]
        for rates, _ in groups
    ]
    whole = [[*row, *(each[i] for each in held)] for i, row in enumerate(mass)]
    for k, row in enumerate(held):
        below: list[Scalar] = [0.0] * len(held)
        below[k] = -(active[k] * shift[k] + (1.0 - active[k]) * one[k])
        whole.append([*row, *below])
    arrow = eliminated(frames, whole, [[first + k for k in rows] for rows in own])
    margins: list[Scalar] = [0.0] * len(held)
    free = {c: 1.0 / mass[c][c] for c in core}
    for limb, rows in zip(arrow.limbs, own, strict=True):
        factors = limb.factors
        for place, k in enumerate(rows):
            pivot = entry = -factors.pivots[place]
            for later in range(place + 1, len(rows)):
                entry = entry - factors.lower[later][place] * factors.scaled[later][place]
            for c, share in free.items():
                entry = entry + held[k][c] * held[k][c] * share
            margins[k] = pivot - LEAST_SHARE * entry
    return arrow, margins


def pushed_slopes_of_limbs(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    forces: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[list[Scalar]]:
    """Compute the derivatives of J^T f by q, as `pushed_slopes` (constraints.py), with contacts on equal limbs only. In the
    rows and columns of the core, they are sums over limbs."""
    core, nv = limbs_of(frames)[0], first_rates(frames)[-1]
    found: list[list[Scalar]] = [[0.0] * nv for _ in range(nv)]
    left = iter(forces)
    for each in named:
        total = _sum_over_limbs(frames, each.joint)
        slopes = pushed_slopes(frames, [each], q, list(islice(left, each.rows)), root)
        for i, row in enumerate(slopes):
            for j, value in enumerate(row):
                found[i][j] = found[i][j] + (total(value) if i in core and j in core else value)
    return found


def _sum_over_limbs(frames: Sequence[Frame], joint: int) -> Callable[[Scalar], Scalar]:
    """The function that sums over the limbs to which a joint belongs."""
    while (total := frames[joint].limbs) is None:
        joint = frames[joint].parent
    return total


class Trunk:
    """The axes of a floating base, along which contacts cost the least operations. Without a floating base, these are
    the axes of the robot's base.

    q  positions of the robot, with the floating base where it is at zero
    """

    def __init__(self, frames: Sequence[Frame], q: Sequence[Scalar], axes: Axes) -> None:
        self._frame, self._axes = frames[0], axes
        self._turn = None
        self.q = list(q)
        if has_floating_base(frames):
            self._turn = joint_turn(frames[0], positions(frames, q)[0])
            start = frames[0].joint.neutral
            self.q = [*start, *q[len(start) :]]

    def along(self, v: Vector) -> Vector:
        """Return a vector along the axes of the trunk, given along the axes of the base."""
        if self._turn is None:
            return v
        turned = outward(self._turn, from_previous(self._frame, transform(transpose(self._axes), v)))
        return transform(self._axes, to_previous(self._frame, turned))

    def back(self, v: Vector) -> Vector:
        """Return a vector along the axes of the base, given along the axes of the trunk."""
        if self._turn is None:
            return v
        turned = inward(self._turn, from_previous(self._frame, transform(transpose(self._axes), v)))
        return transform(self._axes, to_previous(self._frame, turned))

    def rows_along(self, values: Sequence[Scalar]) -> list[Scalar]:
        """Turn the linear and the angular vectors of contacts, one after the other, to the axes of the trunk."""
        return _each(self.along, values)

    def rows_back(self, values: Sequence[Scalar]) -> list[Scalar]:
        """Turn the forces and moments of contacts, one after the other, to the axes of the base."""
        return _each(self.back, values)


def _each(turned: Callable[[Vector], Vector], values: Sequence[Scalar]) -> list[Scalar]:
    vectors = zip(*[iter(values)] * 3, strict=True)
    return [x for vector in vectors for x in turned(vector)]
