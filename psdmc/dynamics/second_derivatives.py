"""Second derivatives of weighted torques, lambda . tau, by q, qd and qdd: a recursion over composites.

Let u be the velocities of all points at the joint rates lambda. By d'Alembert's principle, lambda . tau is the integral of
u . x'' over the mass. A small motion of joint j changes u, the velocities and the accelerations of all points beyond it, by
what follows from the motion of the link before the joint (derivatives.py). First derivatives are therefore

    d / d q_j    =  D_j . F + A . z_j'' + B . z_j' + C . (a_j x z_j)
    d / d qd_j   =  2 A . z_j' + B . z_j
    d / d qdd_j  =  A . z_j

with A = int r x u dm, B = 2 int r' x u dm and C = int u dm over the bodies beyond joint j, and the wrench F that they
require. D_j is the twist by which u changes, omega x z and v x z, if the link before the joint moves with the angular
velocity omega, and the joint's origin with v, at the rates lambda. The sums without D_j . F are those of the first
derivatives of one torque, with u in the place of t_i.

Of all this, the motion of a joint k beyond joint j changes F, A, B and C alone. So the second derivatives are the same sums
of the derivatives of F, A, B and C by the position, rate and acceleration of joint k, carried from joint k to the base.

Nganga, Wensing 2021 differentiate lambda . tau once by such a recursion, and again automatically.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.coordinates import as_tuple, both_summed, each_summed, first_rates, on_coordinates, rates
from psdmc.dynamics.derivatives import (
    Swept,
    by_axis,
    composites,
    leaf_body,
    swept,
    torque_rows,
    wrenches_of_motions,
)
from psdmc.dynamics.frames import BASE, Frame, from_previous, leaves, outward
from psdmc.dynamics.joint_steps import Axis, Row, Step, Wrench, by_own_axes
from psdmc.dynamics.moving_composite import (
    Composite,
    Momenta,
    along_parent,
    before_turn,
    both,
    handed_composite,
    moved_to,
)
from psdmc.dynamics.scalar import ZERO, Matrix, Scalar, Vector, add, cross, dot, scale, transform
from psdmc.dynamics.solve import Matrix as Rows
from psdmc.dynamics.spatial import Body, combined, full, momentum_of
from psdmc.robot.joints import JointType

Motion = tuple[Vector, Vector]
"""A twist at an origin: the origin's linear velocity, and the angular one."""

MASSLESS = Body(0.0, ZERO, (0.0,) * 6)


class SecondDerivatives(NamedTuple):
    """Second derivatives of the weighted torques, nv x nv each; row: by the first letter. Those by qd and qdd, and by qdd
    twice, are zero."""

    by_q_q: Rows
    by_q_qd: Rows
    by_qd_qd: Rows
    by_q_qdd: Rows

    @property
    def hessian(self) -> Rows:
        """The 3 nv x 3 nv symmetric matrix by (q, qd, qdd)."""
        q_q, q_qd, qd_qd, q_qdd = self
        rows = [(*q, *qd, *qdd) for q, qd, qdd in zip(q_q, q_qd, q_qdd, strict=True)]
        still = (0.0,) * len(rows)
        rows += [(*q, *qd, *still) for q, qd in zip(zip(*q_qd, strict=True), qd_qd, strict=True)]
        return (*rows, *((*q, *still, *still) for q in zip(*q_qdd, strict=True)))


@on_coordinates(each_summed(both_summed))
def inverse_dynamics_second_derivatives(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    weights: Sequence[Scalar],
    base_acceleration: Vector,
    choices: Choices = PLAIN,
) -> SecondDerivatives:
    """Second derivatives of the sum of weights[i] tau[i]; arguments as those of `inverse_dynamics`. Drives add nothing.

    Those by q are of the sum at q (+) x by the entries of x at zero, x constant rates for a second: symmetric also for
    joints of several coordinates. Exact zeros where neither joint carries the other.
    """
    first, weights = first_rates(frames), rates(frames, weights)
    moving = swept(frames, q, qd, qdd, base_acceleration, choices)
    before: list[Motion] = []
    for i, step in enumerate(moving.steps):
        before.append(_motion_before(frames, i, step, before, weights))
    own = _weighted_composites(moving, bodies, weights, before)
    blocks = [[[0.0] * first[-1] for _ in range(first[-1])] for _ in range(4)]
    for i, composite in composites(moving, bodies):
        changes = _changes(frames[i], moving.axes[i], composite, own[i], before[i], moving.qd[i])
        for k, change in enumerate(changes, start=first[i]):
            _fill(blocks, (i, k), moving, before, change)
    return SecondDerivatives(*(tuple(tuple(row) for row in block) for block in blocks))


# Motions at the rates lambda: those of links, and the moments of their points.
def _motion_before(
    frames: Sequence[Frame], i: int, step: Step, before: Sequence[Motion], weights: Sequence[Scalar]
) -> Motion:
    """The motion of the link before a joint at the joint's origin, in the joint's orientation."""
    frame, parent = frames[i], frames[i].parent
    if parent == BASE:
        return ZERO, ZERO
    linear, angular = _after(frames[parent], before[parent], weights[parent])
    if not step.joins:
        linear, angular = outward(step.turn, linear), outward(step.turn, angular)
    linear = add(linear, cross(angular, step.offset))
    if step.joins:
        return linear, angular
    return (
        outward(step.own, from_previous(frame, linear)),
        outward(step.own, from_previous(frame, angular)),
    )


def _after(frame: Frame, motion: Motion, weights: Scalar) -> Motion:
    """The motion of the link beyond a joint, from that of the link before it."""
    linear, angular = combined(frame.joint, as_tuple(weights))
    return add(motion[0], linear), add(motion[1], angular)


def _weighted_composites(
    moving: Swept, bodies: Sequence[Body], weights: Sequence[Scalar], before: Sequence[Motion]
) -> list[Composite]:
    """Return for each joint the moments of u over the bodies beyond it, in the joint's orientation about its origin. In the
    place of momenta are int r u^T and int u, and in that of a moment is B."""
    frames, forward = moving.frames, moving.forward
    found = [Composite(MASSLESS, Momenta((ZERO, ZERO, ZERO), ZERO), (ZERO, ZERO))] * len(frames)
    hung: list[list[Composite]] = [[] for _ in frames]
    joined_to: list[list[Composite]] = [[] for _ in frames]
    is_leaf = leaves(frames)
    for i in reversed(range(len(frames))):
        frame, step = frames[i], moving.steps[i]
        linear, angular = _after(frame, before[i], weights[i])
        slide, turning = combined(frame.joint, as_tuple(moving.qd[i]))
        if is_leaf[i] and frame.joint.about_z:
            body = leaf_body(moving, i, bodies[i])
            whole = _moments(body, add(moving.axes[i].w, turning), (linear, angular))
        else:
            turn = forward.compound_turns[i] if frame.joint.about_z else None
            motion = outward(turn, linear), outward(turn, angular)
            whole = _moments(bodies[i], forward.rates[i].w, motion)
            for child in hung[i]:
                whole = both(whole, child)
            whole = before_turn(whole, turn)
            for child in joined_to[i]:
                whole = both(whole, child)
        whole = _with_b(whole, scale(cross(slide, whole.momenta.first), 2.0))
        found[i] = whole
        if frame.parent == BASE:
            continue
        if not step.joins:
            whole = along_parent(frame, before_turn(whole, step.own))
        whole = _with_b(moved_to(whole, step.offset), cross(step.velocity, whole.momenta.first))
        (joined_to if step.joins else hung)[frame.parent].append(handed_composite(frame, whole))
    return found


def _moments(body: Body, w: Vector, motion: Motion) -> Composite:
    """The moments of u over one body, which turns with w."""
    (linear, angular), h, second = motion, body.moment, full(body.second)
    rows = [add(scale(linear, x), cross(angular, row)) for x, row in zip(h, second, strict=True)]
    first = add(scale(linear, body.mass), cross(angular, h))
    b = add(transform(second, cross(w, angular)), cross(cross(w, h), linear))
    return Composite(MASSLESS, Momenta((rows[0], rows[1], rows[2]), first), (ZERO, scale(b, 2.0)))


def _with_b(composite: Composite, more: Vector) -> Composite:
    force, b = composite.wrench
    return composite._replace(wrench=(force, add(b, more)))


# What the motion of one joint changes for the joints before it.
class Change(NamedTuple):
    """Derivatives about an origin: of the wrench that the bodies beyond a joint require, by the joint's position, rate and
    acceleration; and of the row A, B, C of u by the position and rate."""

    moved: Wrench
    pushed: Wrench
    driven: Wrench
    row: Row
    slope: Row

    def carried(self, step: Step) -> Change:
        """Return the change at the parent's origin, in its orientation."""
        moved, pushed, driven = (step.carried(wrench) for wrench in (self.moved, self.pushed, self.driven))
        return Change(moved, pushed, driven, step.carried_row(self.row), step.carried_row(self.slope))


def _changes(
    frame: Frame, axis: Axis, composite: Composite, own: Composite, before: Motion, qd: Scalar
) -> list[Change]:
    """Return the changes by each of a joint's rates."""
    wrenches = wrenches_of_motions(frame, axis, composite, qd)
    driven = [(row.c, row.a) for row in torque_rows(frame, axis, composite)]
    (w, c), (_, b) = own.momenta, own.wrench
    whole = Row((w[1][2] - w[2][1], w[2][0] - w[0][2], w[0][1] - w[1][0]), b, c)
    found = []
    for (slide, turn), (moved, pushed), drive in zip(frame.joint.twists, wrenches, driven, strict=True):
        row = _moved_row(axis, composite, w, whole, before, (slide, turn))
        slope = scale(add(_turning_twice(w, turn), cross(slide, c)), 2.0)
        found.append(Change(moved, pushed, drive, row, Row(ZERO, slope, ZERO)))
    return found


def _moved_row(axis: Axis, composite: Composite, w: Matrix, whole: Row, before: Motion, twist: Motion) -> Row:
    """Return the derivative of A, B and C if the bodies beyond a joint move with a twist. They take along what moves
    relative to the link before the joint. As seen by them, u gets the field of the bent twist, and r' that of the link's
    motion."""
    (slide, turn), (bent, bend) = twist, _bent(before, twist)
    body, (second, first), _ = composite
    force, moment = momentum_of(body, (bent, bend))
    a = add(add(cross(turn, whole.a), cross(slide, whole.c)), moment)
    c = add(cross(turn, whole.c), force)
    trace = second[0][0] + second[1][1] + second[2][2]
    drifting = add(first, scale(cross(axis.w, body.moment), 2.0))
    swept = add(scale(bend, trace), scale(transform(second, bend), -1.0))
    swept = add(swept, cross(drifting, bent))
    own = add(_turning_twice(w, cross(axis.w, turn)), cross(cross(axis.w, slide), whole.c))
    own = add(own, transform(full(body.second), cross(axis.w, bend)))
    return Row(a, add(add(cross(turn, whole.b), swept), scale(own, 2.0)), c)


def _turning_twice(w: Matrix, e: Vector) -> Vector:
    """int (e x r) x u dm, with w = int r u^T dm."""
    trace = w[0][0] + w[1][1] + w[2][2]
    return add(transform(w, e), scale(e, -trace))


def _bent(motion: Motion, twist: Motion) -> Motion:
    """The motion's cross product with a constant twist."""
    (linear, angular), (slide, turn) = motion, twist
    return add(cross(angular, slide), cross(linear, turn)), cross(angular, turn)


def _fill(
    blocks: Sequence[list[list[Scalar]]],
    at: tuple[int, int],
    moving: Swept,
    before: Sequence[Motion],
    change: Change,
) -> None:
    """Set the entries of joint and rate `at` with its own joint and all joints before it."""
    j, k = at
    frames = moving.frames
    first = first_rates(frames)
    q_q, q_qd, qd_qd, q_qdd = blocks
    while True:
        joint = frames[j].joint
        turned_row, slope = (
            _by_joint(joint, moving.axes[j], row, moving.qd[j]) for row in (change.row, change.slope)
        )
        for number, twist in enumerate(joint.twists):
            place, field = first[j] + number, _bent(before[j], twist)
            both_q = _power(field, change.moved) + turned_row[0][number]
            q_qd[place][k] = _power(field, change.pushed) + slope[0][number]
            q_qdd[place][k] = _power(field, change.driven)
            if j == at[0]:
                _add_half(q_q, place, k, both_q)
                _add_half(qd_qd, place, k, slope[1][number])
                continue
            q_q[place][k] = q_q[k][place] = both_q
            qd_qd[place][k] = qd_qd[k][place] = slope[1][number]
            q_qd[k][place], q_qdd[k][place] = turned_row[1][number], turned_row[2][number]
        if frames[j].parent == BASE:
            return
        change, j = change.carried(moving.steps[j]), frames[j].parent


def _by_joint(
    joint: JointType, axis: Axis, row: Row, rates: Scalar
) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...], tuple[Scalar, ...]]:
    return by_axis(joint, axis, row) if joint.about_z else by_own_axes(joint, axis, row, rates)


def _power(motion: Motion, wrench: Wrench) -> Scalar:
    return dot(motion[0], wrench[0]) + dot(motion[1], wrench[1])


def _add_half(block: list[list[Scalar]], i: int, j: int, value: Scalar) -> None:
    """Set an entry to the mean of those of both orders, of which `value` is one. Motions of one joint along its own axes do
    not commute."""
    if i == j:
        block[i][j] = value
    else:
        block[i][j] = block[j][i] = block[i][j] + 0.5 * value
