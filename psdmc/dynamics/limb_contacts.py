"""Contact forces on equal limbs (such as legs), eliminated limb by limb.

The motion x and the contact forces f solve M x - J^T f = load and J x + shift f = wanted. With g = -f, the matrix of these
equations is symmetric. The forces on a limb are further rows of the limb. With M and J in the rows l of one limb,
elimination of its rates and then of its forces needs no larger matrix than

    D = J_l M_ll^-1 J_l^T + shift

Only a matrix with the rows of the core (such as a trunk) is a sum over limbs. This elimination loses digits if D is much
smaller than J M^-1 J^T + shift, as at a straight knee.

Source: Featherstone 2008, sections 6.5 and 8.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

from psdmc.dynamics.arrow import Arrow, Matrix, eliminated, limbs_of
from psdmc.dynamics.contacts import pushed_slopes
from psdmc.dynamics.frames import Frame, from_previous, inward, joint_turn, outward, to_previous
from psdmc.dynamics.free_root import has_free_root
from psdmc.dynamics.kinematics import AT_BASE
from psdmc.dynamics.named_frames import Root
from psdmc.dynamics.scalar import Matrix as Axes
from psdmc.dynamics.scalar import Scalar, Vector, transform, transpose
from psdmc.dynamics.slices import first_rates, positions
from psdmc.dynamics.solve import is_zero
from psdmc.robot.mechanism import NamedFrame

LEAST_SHARE = 1e-3
"""The least share of its diagonal entry that a pivot of D must have."""


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
    `constrained` (contacts.py). A contact that is not active has no force.
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
            for c, inverse in free.items():
                entry = entry + held[k][c] * held[k][c] * inverse
            margins[k] = pivot - LEAST_SHARE * entry
    return arrow, margins


def pushed_slopes_of_limbs(
    frames: Sequence[Frame],
    named: Sequence[NamedFrame],
    q: Sequence[Scalar],
    forces: Sequence[Scalar],
    root: Root = AT_BASE,
) -> list[list[Scalar]]:
    """Compute the derivatives of J^T f by q, as `pushed_slopes` (contacts.py), with contacts on equal limbs only. In the
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
        if has_free_root(frames):
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
