"""Contact forces, for several generated functions: recorded as code, computed in NumPy, and computed with Pinocchio."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.closed_loops import ANGULAR, loop_jacobian
from psdmc.dynamics.constraints import Constrained, constrained, contact_jacobian
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import Factors, factorize, inverse, inverse_diagonal
from psdmc.program.operations import Op
from psdmc.program.signature import Quantity, Structure, SymmetricMatrix
from psdmc.recipes.on_arrays import columns, matrix
from psdmc.recipes.recipe import Given, Ingredients, Reference, RobotOnArrays
from psdmc.recipes.singular_matrices import regular
from psdmc.robot.mechanism import Array, Loop, NamedFrame

_ROWS = "A contact point has three linear {0}. A contact surface has three linear and then three angular {0}"
ROW_WORDS = f"along the axes of the base frame. {_ROWS}"
CONSTRAINT_WORDS = (
    f"{ROW_WORDS}. Then follow the {{0}} of closed loops, if the robot has any, along and about the axes of each loop's "
    "first frame"
)
LOCAL_ROW_WORDS = f"along the axes of each contact. {_ROWS}"

ACTIVE = Quantity(
    "active",
    ("contacts",),
    largest=1.0,
    least=0.0,
    means="1 for each contact that touches the world, 0 for each that does not",
    unit="1",
    whole=True,
)

MU = Quantity(
    "mu",
    largest=1.0,
    least=0.1,
    means="regularisation, 0 or more (not a friction coefficient). psdmc adds mu to the diagonal entries of J "
    "M^-1 J^T, with the Jacobian J and the mass matrix M. The unit is 1/kg in linear rows and 1/(kg m^2) in "
    "angular rows",
    unit="1/kg",
    default=0.0,
    allowed=(0.0, np.inf),
)

CONTACTS = SymmetricMatrix(
    "J M^-1 J^T + mu I of the active contacts",
    Structure.DENSE,
    ("constraints",),
    number="the number, from 0, of the contact at which J M^-1 J^T + mu I of the active contacts is not positive definite, "
    "or whose active is neither 0 nor 1",
    failure="an entry of active is neither 0 nor 1\nmu is negative\nJ M^-1 J^T + mu I of the active contacts is not "
    "positive definite, for example because mu = 0 and two active contacts prevent the same motion",
    error="{constraints}: J M^-1 J^T + mu I of the active contacts is not positive definite at mu = {mu:g}",
    hint="give mu > 0, such as 1e-6, if contacts hold more motions than the robot has",
)

NOTHING = 1e-30
"""An active in this distance from 0 is 0: a and a^2 are then equal within rounding, as they are at 0 and 1."""

Rows = Sequence[Sequence[Scalar]]

Solved = tuple[Constrained, list[Scalar], Factors, list[list[Scalar]]]
"""The solution, a sign for each contact, the factors of the mass matrix, and the contact Jacobian."""


class Held(NamedTuple):
    """The contacts that act on a robot. The world prescribes the accelerations of the active contacts, along 3 or 6
    axes (rows) for each.

    named   the named frames, some of which are contacts
    loops   the closed loops, whose rows follow those of the contacts and are always active
    active  1 for each contact that touches the world, else 0
    mu      regularisation: what is added to the diagonal of J M^-1 J^T
    si      returns a constant from its value and its unit
    """

    named: Sequence[NamedFrame]
    active: Sequence[Scalar]
    mu: Scalar
    si: Callable[[float, str], Scalar] = lambda value, unit: value
    loops: Sequence[Loop] = ()

    @staticmethod
    def of(g: Ingredients) -> Held:
        """Return the contacts and the loops of a trace, by the inputs active and mu."""
        return Held(g.named, g.inputs[ACTIVE.name], g.inputs[MU.name][0], g.si, g.loops)

    @staticmethod
    def on_arrays(robot: RobotOnArrays, given: Given, loops: Sequence[Loop] = ()) -> Held:
        """Return the contacts of many states, in NumPy."""
        mu = np.reshape(given[MU.name], -1)
        return Held(robot.chain.frames, list(given[ACTIVE.name].T), mu, loops=loops)

    @property
    def axes(self) -> list[Sequence[int]]:
        """For each contact and each loop its rows: 0 to 2 along an axis, 3 to 5 about an axis."""
        return [*(range(each.rows) for each in self.named if each.rows), *(loop.rows for loop in self.loops)]

    @property
    def counts(self) -> list[int]:
        """The number of rows of each contact and of each loop."""
        return [len(own) for own in self.axes]

    @property
    def acting(self) -> list[Scalar]:
        """For each contact and each loop, whether it acts."""
        return [*self.active, *(1.0 for _ in self.loops)]

    @property
    def rows(self) -> tuple[list[Scalar], list[Scalar], list[Scalar]]:
        """For each row: whether its contact is active, what is added to the diagonal, and a one in the diagonal's
        unit."""
        si, axes = self.si, self.axes
        shift = [self.mu] * 3 + [self.mu * si(1.0, "1/m^2")] * 3
        unit = [si(1.0, "1/kg")] * 3 + [si(1.0, "1/(kg m^2)")] * 3
        return (
            [on for on, own in zip(self.acting, axes, strict=True) for _ in own],
            [shift[row] for own in axes for row in own],
            [unit[row] for own in axes for row in own],
        )

    def compliance(self, factors: Factors) -> list[list[Scalar]]:
        """Return the inverse of J M^-1 J^T + mu I in the active rows and columns, and zeros in the others. `factors` are
        those of the matrix that has ones there."""
        on, _, _ = self.rows
        found = inverse(factors)
        for i, row in enumerate(found):
            row[i] = on[i] * row[i]
        return found

    def solved(
        self, factors: Factors, jacobian: Rows, load: Sequence[Scalar], wanted: Sequence[Scalar]
    ) -> tuple[Constrained, list[Scalar]]:
        """Return the motion and the contact forces, as `constrained` computes them. Return a sign for each contact, and
        for each loop, too: -1 if the matrix of the active contacts is not positive definite there, else 1."""
        found = constrained(factors, jacobian, load, wanted, *self.rows)
        return found, self.independent(found.matrix, found.factors, inverse_diagonal(found.factors))

    def independent(self, matrix: Rows, factors: Factors, inverse: Sequence[Scalar]) -> list[Scalar]:
        """Return a sign for each contact: -1 if `matrix` is not positive definite there, or if active or mu is not
        allowed, else 1. `inverse` is the diagonal of the inverse matrix."""
        signs, first, sizes = [], 0, self._sizes(matrix)
        for number, (untested, count) in enumerate(zip(self.allowed(), self.counts, strict=True)):
            sign = untested
            for k in range(first, first + count):
                sign = regular(sign, factors.pivots[k], sizes[k], inverse[k])
            if self.loops and number < len(self.active):
                # Where loops have no solution, contacts that are not active are not at fault.
                sign = Op.SELECT(self.active[number], 0.5, untested, sign)
            signs.append(sign)
            first += count
        return signs

    def _sizes(self, matrix: Rows) -> list[Scalar]:
        """For each row the sum of the diagonal entries of its contact's linear rows, or of its angular rows. Near a dead
        point, a row of J is a small difference of large numbers, and its own entry hides the digits that this cost."""
        kinds = [(number, axis >= ANGULAR) for number, own in enumerate(self.axes) for axis in own]
        sums: dict[tuple[int, bool], Scalar] = {}
        for k, kind in enumerate(kinds):
            sums[kind] = sums[kind] + matrix[k][k] if kind in sums else matrix[k][k]
        return [sums[kind] for kind in kinds]

    def signs(self, positive: Sequence[Scalar]) -> list[Scalar]:
        """Return a sign for each contact. It is -1 if a number of one of its rows is not positive, or if active or mu is
        not allowed, else 1."""
        signs, left = [], iter(positive)
        for sign, count in zip(self.allowed(), self.counts, strict=True):
            for value in islice(left, count):
                sign = Op.SELECT(0.0, value, sign, -1.0)
            signs.append(sign)
        return signs

    def allowed(self) -> Iterator[Scalar]:
        """Yield a sign for each contact: -1 if active or mu is not allowed, else 1."""
        for on in self.active:
            off = on - on * on
            sign = Op.SELECT(off, NOTHING, Op.SELECT(self.mu, 0.0, -1.0, 1.0), -1.0)
            yield Op.SELECT(-NOTHING, off, sign, -1.0)
        for _ in self.loops:
            yield Op.SELECT(self.mu, 0.0, -1.0, 1.0)


def held_on_arrays(
    robot: RobotOnArrays,
    given: Given,
    wanted: Callable[[Array], Array],
    loops: Sequence[Loop] = (),
) -> tuple[Array, Array, Array]:
    """Solve for the motion with active contacts, in NumPy, for k states without applied torques.

    Return the motion x (k, nv), such as accelerations, the contact forces f (k, rows), and numbers that must be
    positive. These are the pivots of the mass matrix and a sign for each contact. `wanted` computes the prescribed
    motion of the contacts (k, rows) from the contact Jacobian J (k, rows, nv). The rows of `loops` follow those of the
    contacts.
    """
    q, count = list(given["q"].T), len(given["q"])
    mass = np.moveaxis(robot.mass_matrix(given["q"]), 0, -1)
    factors = factorize([list(row) for row in mass])
    rows = contact_jacobian(robot.frames, robot.chain.frames, q)
    if loops:
        rows += loop_jacobian(robot.frames, loops, q)
    right = list(wanted(matrix(rows, count)).T)
    mask = Held.on_arrays(robot, given, loops)
    with np.errstate(all="ignore"):
        found, signs = mask.solved(factors, rows, [0.0] * robot.nv, right)
    return (
        columns(found.motion, count),
        columns(found.forces, count),
        columns([*factors.pivots, *signs], count),
    )


def joined(of_contacts: Array, of_loops: Array) -> Array:
    """Return values for the rows of contacts and then of closed loops, (k, rows, ...)."""
    return np.concatenate([of_contacts, of_loops], axis=1)


def held_rows(robot: Reference, given: Given) -> NDArray[np.bool_]:
    """Return which rows of the contacts are active, and true for each row of the closed loops, (k, rows)."""
    loops = sum(len(rows) for _, _, rows in robot.loops)
    active = np.repeat(given[ACTIVE.name], [rows for _, rows in robot.contacts], axis=1) > 0.5
    return np.pad(active, ((0, 0), (0, loops)), constant_values=True)


def dense_solution(
    robot: Reference, given: Given, jacobian: Array, load: Array, wanted: Array
) -> tuple[Array, Array]:
    """Return the motion x (k, nv) and the contact forces f (k, rows) for k states. They are the reference for tests.

    They solve the full linear system M x - J^T f = load, J x + mu f = wanted. M is Pinocchio's mass matrix, J the
    Jacobian of the active contacts and mu the regularisation. Load and wanted may have columns, (k, nv, columns) and
    (k, rows, columns); the results then have them, too.
    """
    masks = held_rows(robot, given)
    motion, forces = np.zeros(load.shape), np.zeros(wanted.shape)
    for k, (mass, on, mu) in enumerate(
        zip(robot.mass_matrix(given["q"]), masks, np.reshape(given[MU.name], -1), strict=True)
    ):
        own = jacobian[k, on]
        whole = np.block([[mass, -own.T], [own, mu * np.eye(len(own))]])
        found = np.linalg.solve(whole, np.concatenate([load[k], wanted[k, on]]))
        motion[k], forces[k, on] = np.split(found, [len(mass)])
    return motion, forces
