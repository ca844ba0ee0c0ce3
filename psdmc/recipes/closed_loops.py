"""The passive joints of a mechanism with closed loops: their motion from that of the other joints, and the loops' forces.

The loops' Jacobian has the square block J_p of passive rates, and the block J_a of all others. From J qd = 0 and
J qdd + dJ/dt qd = 0 follow the passive rates and accelerations. The loops' forces f balance the tree's torques of the
passive joints, J_p^T f = tau_p; the other joints then have the torques tau_a - J_a^T f.

Source: Featherstone 2008, chapter 8."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from psdmc.dynamics.closed_loops import ANGULAR, loop_drift, loop_error, loop_jacobian
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.kinematics import AT_BASE, Root
from psdmc.dynamics.manifold import integrated
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import Factors, factorize, inner_product, inverse_diagonal, solve
from psdmc.program.operations import Op
from psdmc.program.signature import QD, QDD, Structure, SymmetricMatrix
from psdmc.recipes.recipe import Reference
from psdmc.recipes.singular_matrices import regular
from psdmc.robot.joints.scalars import root as root_of
from psdmc.robot.mechanism import Array, Loop

PASSIVE = SymmetricMatrix(
    "J_p J_p^T",
    Structure.DENSE,
    ("loop_rows",),
    number="the number, from 0, of the row of the closed loops at which the block J_p of their Jacobian is singular",
    failure="the block J_p of the loops' Jacobian that belongs to passive joints is singular, for example in a dead point",
    error="{loop_rows}: the passive joints do not follow from the others here, because the loops' Jacobian J_p is singular",
    hint="avoid this position, such as a dead point, or declare other passive joints in [[loop]]",
)

MOVING = ", of which the entries of passive joints are not used"
RATES_MEAN = f"{QD.means}{MOVING}"
ACCELERATIONS_MEAN = f"{QDD.means}{MOVING}"

ROW_WORDS = (
    "along and about the axes of the loop's first frame. There is one {} for each direction that a loop blocks. "
    "The order is loop by loop, first linear directions (x, y, z), then angular ones (rx, ry, rz)"
)


class PassiveJoints(NamedTuple):
    """The solved equations of passive joints at one position.

    jacobian  J, a row of nv entries per row of the loops
    numbers   numbers of the passive rates
    scales    for each of them a radian or a metre: J_p times these has one unit in each row
    rows      J_p times the scales
    factors   factors of the product of this matrix and its transpose
    signs     for each row, -1 if J_p is singular there, else 1
    """

    jacobian: Sequence[Sequence[Scalar]]
    numbers: list[int]
    scales: list[Scalar]
    rows: list[list[Scalar]]
    factors: Factors
    signs: list[Scalar]

    @staticmethod
    def at(
        frames: Sequence[Frame],
        loops: Sequence[Loop],
        q: Sequence[Scalar],
        si: Callable[[float, str], Scalar] = lambda value, unit: value,
        root: Root = AT_BASE,
    ) -> PassiveJoints:
        """Return the equations at q. `si` returns a constant from its value and its unit."""
        jacobian = loop_jacobian(frames, loops, q, root)
        numbers, slides = passive_rates(frames, loops)
        every = [si(1.0, "m") if slide else 1.0 for slide in slides]
        scales = [every[k] for k in numbers]
        whole = [[scale * x for scale, x in zip(every, row, strict=True)] for row in jacobian]
        rows = [[row[k] for k in numbers] for row in whole]
        wide = [[inner_product(a, b) for b in rows] for a in rows]
        factors = factorize(wide)
        diagonal = inverse_diagonal(factors)
        signs = [
            regular(1.0, pivot, size, entry)
            for pivot, size, entry in zip(factors.pivots, _sizes(loops, whole), diagonal, strict=True)
        ]
        return PassiveJoints(jacobian, numbers, scales, rows, factors, signs)

    def completed(self, rates: Sequence[Scalar], bias: Sequence[Scalar] | None = None) -> list[Scalar]:
        """Return the rates, or accelerations, whose passive entries satisfy J x + bias = 0, from those of the others."""
        moving = [0.0 if k in self.numbers else rate for k, rate in enumerate(rates)]
        right = [-inner_product(row, moving) for row in self.jacobian]
        if bias is not None:
            right = [x - y for x, y in zip(right, bias, strict=True)]
        found = self._across(right)
        # One step of refinement: the square of J_p in the factors loses digits.
        rest = [x - inner_product(row, found) for x, row in zip(right, self.rows, strict=True)]
        found = [x + y for x, y in zip(found, self._across(rest), strict=True)]
        for k, scale, value in zip(self.numbers, self.scales, found, strict=True):
            moving[k] = scale * value
        return moving

    def size(self, step: Sequence[Scalar]) -> Scalar:
        """Return the sum of the squares of a motion of passive joints, in rad and m."""
        parts = [step[k] / scale for k, scale in zip(self.numbers, self.scales, strict=True)]
        return inner_product(parts, parts)

    def _across(self, right: Sequence[Scalar]) -> list[Scalar]:
        shares = solve(self.factors, right)
        return [inner_product(column, shares) for column in zip(*self.rows, strict=True)]

    def forces(self, torques: Sequence[Scalar]) -> list[Scalar]:
        """Return the loops' forces f that balance the torques of the passive joints: J_p^T f = tau_p."""
        right = [scale * torques[k] for k, scale in zip(self.numbers, self.scales, strict=True)]
        found = self._down(right)
        columns = zip(*self.rows, strict=True)
        rest = [x - inner_product(column, found) for x, column in zip(right, columns, strict=True)]
        return [x + y for x, y in zip(found, self._down(rest), strict=True)]

    def _down(self, right: Sequence[Scalar]) -> list[Scalar]:
        return solve(self.factors, [inner_product(row, right) for row in self.rows])

    def carried(self, torques: Sequence[Scalar], forces: Sequence[Scalar]) -> list[Scalar]:
        """Return the torques less J^T f, and 0 for passive joints."""
        return [
            0.0 if k in self.numbers else torque - inner_product([row[k] for row in self.jacobian], forces)
            for k, torque in enumerate(torques)
        ]


def motion(
    frames: Sequence[Frame],
    loops: Sequence[Loop],
    state: tuple[Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]],
    si: Callable[[float, str], Scalar] = lambda value, unit: value,
    root: Root = AT_BASE,
) -> tuple[PassiveJoints, list[Scalar], list[Scalar]]:
    """Return the equations of the passive joints, and all rates and accelerations, from q, qd and qdd."""
    q, qd, qdd = state
    joints = PassiveJoints.at(frames, loops, q, si, root)
    rates = joints.completed(qd)
    return joints, rates, joints.completed(qdd, loop_drift(frames, loops, q, rates, root))


LAST = 1.0 / 64.0
"""A step of Newton's method is the last one if its square, times this, is lost in rounding beside 1: steps below 8.4e-8 rad
(float64) or 2e-3 rad (float32). The error that such a step leaves is of the order of its square: about 64 roundings."""


def closer(
    frames: Sequence[Frame],
    loops: Sequence[Loop],
    q: Sequence[Scalar],
    si: Callable[[float, str], Scalar] = lambda value, unit: value,
    root: Root = AT_BASE,
) -> tuple[list[Scalar], list[Scalar]]:
    """Return the positions q after one Newton step of the passive joints towards closed loops, and signs.

    A long step is shortened to less than 1 rad or 1 m in total. A short one is changed by its third power, so that
    convergence stays quadratic. There is a sign for each row of the loops, as in PassiveJoints, and a last one: 1 if the
    step was so short that the loops are now closed within rounding, else -1.
    """
    joints = PassiveJoints.at(frames, loops, q, si, root)
    # The small motion x of the passive joints with J x + error = 0.
    step = joints.completed([0.0] * len(joints.jacobian[0]), loop_error(frames, loops, q, root))
    size = joints.size(step)
    share = 1.0 / root_of(1.0 + size)
    moved = integrated(frames, q, [share * x for x in step])
    passive = {joint for loop in loops for joint in loop.passive}
    moves = [
        j in passive for j, frame in enumerate(frames) if frame.mimic is None for _ in range(frame.joint.nq)
    ]
    there = [new if moving else old for new, old, moving in zip(moved, q, moves, strict=True)]
    return there, [
        *joints.signs,
        Op.SELECT(1.0, 1.0 + LAST * size, -1.0, Op.SELECT(size, size + 1.0, 1.0, -1.0)),
    ]


def _sizes(loops: Sequence[Loop], rows: Sequence[Sequence[Scalar]]) -> list[Scalar]:
    """For each row the sum of the squares of all entries of the loop's linear rows, or of its angular rows. A row of J_p
    can be zero, so its own size says nothing."""
    kinds = [(number, row >= ANGULAR) for number, loop in enumerate(loops) for row in loop.rows]
    sums: dict[tuple[int, bool], Scalar] = {}
    for kind, row in zip(kinds, rows, strict=True):
        sums[kind] = sums.get(kind, 0.0) + inner_product(row, row)
    return [sums[kind] for kind in kinds]


def passive_rates(frames: Sequence[Frame], loops: Sequence[Loop]) -> tuple[list[int], list[bool]]:
    """Return the numbers of the passive rates, and for each rate whether it is linear (m/s), not angular (rad/s)."""
    passive = {joint for loop in loops for joint in loop.passive}
    own = [
        (j, order) for j, frame in enumerate(frames) if frame.mimic is None for order in frame.joint.v_orders
    ]
    numbers = [k for k, (joint, _) in enumerate(own) if joint in passive]
    return numbers, [order != 0 for _, order in own]


def of_loops(robot: Reference, values: Callable[[int, int, tuple[int, ...]], Array]) -> Array:
    """Join the values of all loops, each computed from Pinocchio's numbers of its two frames and from its rows."""
    return np.concatenate([values(*loop) for loop in robot.loops])
