"""Computes derivatives of inverse dynamics by recursion: d tau / d q, d tau / d qd, and M = d tau / d qdd.

When joint j turns by a small angle, each point of the bodies that it carries moves along t_j = z_j x r. Here z_j is the
joint's axis, and r leads from its origin to the point. Relative to these bodies, the link before the joint turns by the
opposite angle. The axis as a vector fixed in that link has the derivatives z' = w x z and z'' = U z. Here w is the
link's angular velocity, and U r the part of its points' acceleration that depends on r. With the acceleration a_j of
the joint's origin, a joint i that j carries (or j itself) has

    d tau_i / d q_j   = A_i . z_j'' + B_i . z_j' + C_i . (a_j x z_j)
    d tau_i / d qd_j  = 2 A_i . z_j' + B_i . z_j
    M_ij              = A_i . z_j

A_i = int r x t_i dm, B_i = 2 int (dr/dt) x t_i dm and C_i = int t_i dm are integrals over the bodies that joint i
carries. Here r leads from the origin of joint j as a point of the link before it. If joint j slides, C_i takes the
place of A_i, and there are no other terms. For joints before i, the derivatives by the motion of joint i follow from
two wrenches. They are the additional wrenches that this motion requires on the bodies after joint i. Their components
along a joint's axis are the torques. The vectors A, B, C and the wrenches are carried from each joint to the base.

Carpentier, Mansard 2018 and Singh, Russell, Wensing 2022 have the same derivatives in spatial vectors. Here they are
written on the pseudo-inertia, and on composite bodies that move (moving_composite.py). When a composite body turns
about z, z x h takes the place of its first moments h in the wrench, and so on. All quantities of a joint are in the
orientation before the joint turns. Those of joints with parallel axes (`compound`) are in the orientation before the
first of them turns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from psdmc.dynamics.choices import PLAIN, Choices
from psdmc.dynamics.coordinates import both_summed, first_rates, on_coordinates, positions, rates, summed
from psdmc.dynamics.frames import BASE, Frame, about_z, inward, joint_angle, leaves
from psdmc.dynamics.joint_steps import (
    Axis,
    Row,
    Step,
    Wrench,
    axis_along,
    axis_and_step,
    bending,
    by_own_axes,
    composite_along,
    from_z,
    unit_twists,
)
from psdmc.dynamics.motion import Forward, sweep_outward
from psdmc.dynamics.moving_composite import (
    Composite,
    along_parent,
    at_rest,
    before_turn,
    both,
    driven,
    driven_freely,
    handed_composite,
    moved_to,
    relieved,
)
from psdmc.dynamics.newton_euler import NO_WRENCHES
from psdmc.dynamics.scalar import Scalar, Vector, add, cross, dot, scale, transform
from psdmc.dynamics.spatial import Body, combined, effort, efforts, momentum_of, spun, turned
from psdmc.robot.joints import JointType

Rows = tuple[tuple[Scalar, ...], ...]


class Derivatives(NamedTuple):
    """Derivatives of torques, n x n each; entry [i][j] is the derivative of torque i by input j.

    They are d tau_i / d q_j, d tau_i / d qd_j and d tau_i / d qdd_j = M_ij. The recursion also gives the n torques of
    gravity, C . (minus gravity).
    """

    by_q: Rows
    by_qd: Rows
    by_qdd: Rows
    gravity: tuple[Scalar, ...]


def _summed(frames: Sequence[Frame], found: Derivatives) -> Derivatives:
    """Sum derivatives by joints to those by the robot's coordinates."""
    by_q, by_qd, by_qdd = (both_summed(frames, rows) for rows in (found.by_q, found.by_qd, found.by_qdd))
    return Derivatives(by_q, by_qd, by_qdd, summed(frames, found.gravity))


@on_coordinates(_summed)
def inverse_dynamics_derivatives(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base_acceleration: Vector,
    choices: Choices = PLAIN,
    external: Mapping[int, Wrench] = NO_WRENCHES,
) -> Derivatives:
    """Compute the derivatives of the joint torques by q, qd and qdd. Arguments are those of `inverse_dynamics`; external
    wrenches move with their links.

    For joints of several coordinates, derivatives by q are along the tangent: by a small motion along each of the
    joint's rates, while the rates stay constant along the moved frame's own axes. Entries of two joints are exact zeros
    if neither joint carries the other.
    """
    moving, first = swept(frames, q, qd, qdd, base_acceleration, choices), first_rates(frames)
    nv, axes = first[-1], moving.axes
    by_q, by_qd, by_qdd = ([[0.0] * nv for _ in range(nv)] for _ in range(3))
    gravity: list[Scalar] = [0.0] * nv
    for i, composite in composites(moving, bodies, external):
        for k, row in enumerate(torque_rows(frames[i], axes[i], composite), start=first[i]):
            gravity[k] = dot(row.c, axes[i].up)
            _fill_row((i, k), moving, row, by_q, by_qd, by_qdd)
        found = wrenches_of_motions(frames[i], axes[i], composite, moving.qd[i])
        for k, wrenches in enumerate(found, start=first[i]):
            _fill_column((i, k), moving, wrenches, by_q, by_qd)
        if frames[i].joint.about_z:
            by_qdd[first[i]][first[i]] = by_qdd[first[i]][first[i]] + drive_inertia[i]
    rows, slopes, mass = (tuple(tuple(row) for row in block) for block in (by_q, by_qd, by_qdd))
    return Derivatives(rows, slopes, mass, tuple(gravity))


@dataclass(frozen=True, slots=True)
class Swept:
    """Describes a robot in motion, after the outward sweep. Sequences have one entry per joint.

    frames, choices  joint frames, and how the sweep is arranged
    q, qd, qdd       position, rate and acceleration of the joint; an entry is a tuple if the joint has several rates
    forward          motions of the bodies
    axes, steps      the joint's axis with its derivatives, and the step from the joint to its parent
    """

    frames: Sequence[Frame]
    choices: Choices
    q: Sequence[Scalar]
    qd: Sequence[Scalar]
    qdd: Sequence[Scalar]
    forward: Forward
    axes: Sequence[Axis]
    steps: Sequence[Step]


def swept(
    frames: Sequence[Frame],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base_acceleration: Vector,
    choices: Choices = PLAIN,
) -> Swept:
    """Compute the motions of the bodies, and each joint's axis and step to its parent, from base to tip. Arguments are
    those of `inverse_dynamics`."""
    forward = sweep_outward(frames, q, qd, None, qdd, base_acceleration, choices)
    q, qd, qdd = positions(frames, q), rates(frames, qd), rates(frames, qdd)
    axes: list[Axis] = []
    steps: list[Step] = []
    for i in range(len(frames)):
        axis, step = axis_and_step(i, frames, qd, qdd, base_acceleration, forward, axes)
        axes.append(axis)
        steps.append(step)
    return Swept(frames, choices, q, qd, qdd, forward, axes, steps)


def composites(
    moving: Swept, bodies: Sequence[Body], external: Mapping[int, Wrench] = NO_WRENCHES
) -> list[tuple[int, Composite]]:
    """For each joint its number and the composite beyond it, in the joint's orientation about its origin; children
    before parents."""
    frames, forward = moving.frames, moving.forward
    found: list[tuple[int, Composite]] = []
    hung: list[list[Composite]] = [[] for _ in frames]
    joined_to: list[list[Composite]] = [[] for _ in frames]
    is_leaf = leaves(frames)
    for i in reversed(range(len(frames))):
        frame, step = frames[i], moving.steps[i]
        whole = at_rest(bodies[i])
        if is_leaf[i] and frame.joint.about_z:
            whole = at_rest(leaf_body(moving, i, bodies[i]))
            if i in external:
                whole = relieved(whole, *(inward(forward.compound_turns[i], v) for v in external[i]))
        else:
            if i in external:
                whole = relieved(whole, *external[i])
            for child in hung[i]:
                whole = both(whole, child)
            if frame.joint.about_z:
                whole = before_turn(whole, about_z(forward.compound_turns[i]))
            for child in joined_to[i]:
                whole = both(whole, child)
        drive = driven if frame.joint.about_z else driven_freely
        whole = drive(frame.joint, whole, moving.qd[i], moving.qdd[i])
        found.append((i, whole))
        if frame.parent != BASE and step.joins:
            joined_to[frame.parent].append(handed_composite(frame, moved_to(whole, step.offset)))
        elif frame.parent != BASE:
            before = moved_to(along_parent(frame, before_turn(whole, step.own)), step.offset)
            hung[frame.parent].append(handed_composite(frame, before))
    return found


def leaf_body(moving: Swept, i: int, body: Body) -> Body:
    """Body i, which carries no other one, in its joint's orientation."""
    angle, step = joint_angle(moving.frames[i], moving.q[i]), moving.steps[i]
    double = (angle + angle).turn() if moving.choices.fold_double_angle else None
    turn = about_z(moving.forward.states[i].turn)
    body = spun(body, turn) if double is None else turned(body, turn, double)
    return spun(body, step.turn) if step.joins else body


def _fill_row(
    at: tuple[int, int],
    moving: Swept,
    row: Row,
    by_q: list[list[Scalar]],
    by_qd: list[list[Scalar]],
    by_qdd: list[list[Scalar]],
) -> None:
    """Set the row of joint and rate `at`, for the joints between that joint and the base: its torque by their motion."""
    j, k = at
    frames = moving.frames
    first = first_rates(frames)
    while True:
        joint, axis = frames[j].joint, moving.axes[j]
        found = (
            by_own_axes(joint, axis, row, moving.qd[j]) if not joint.about_z else by_axis(joint, axis, row)
        )
        for place, (x, y, z) in enumerate(zip(*found, strict=True), start=first[j]):
            by_q[k][place], by_qd[k][place] = x, y
            by_qdd[k][place] = by_qdd[place][k] = z
        if frames[j].parent == BASE:
            return
        row, j = moving.steps[j].carried_row(row), frames[j].parent


def by_axis(joint: JointType, axis: Axis, row: Row) -> tuple[tuple[Scalar], tuple[Scalar], tuple[Scalar]]:
    """Derivatives of a torque with this row by a joint's position, rate and acceleration."""
    turning = dot(row.a, axis.bend) + dot(row.b, axis.rate) + dot(row.c, axis.lever)
    by_q = effort(joint, (0.0, 0.0, dot(row.c, axis.bend)), (0.0, 0.0, turning))
    turning = dot(row.a, axis.twice) + row.b[2]
    by_qd = effort(joint, (0.0, 0.0, dot(row.c, axis.twice)), (0.0, 0.0, turning))
    return (by_q,), (by_qd,), (effort(joint, row.c, row.a),)


def _fill_column(
    at: tuple[int, int],
    moving: Swept,
    wrenches: tuple[Wrench, Wrench],
    by_q: list[list[Scalar]],
    by_qd: list[list[Scalar]],
) -> None:
    """Set the column of joint and rate `at` for the joints before that joint: their torques by its motion."""
    (moved, pushed), (j, k) = wrenches, at
    frames, steps = moving.frames, moving.steps
    first = first_rates(frames)
    while frames[j].parent != BASE:
        moved, pushed, j = steps[j].carried(moved), steps[j].carried(pushed), frames[j].parent
        found = zip(efforts(frames[j].joint, *moved), efforts(frames[j].joint, *pushed), strict=True)
        for place, (x, y) in enumerate(found, start=first[j]):
            by_q[place][k], by_qd[place][k] = x, y


# Wrenches between a joint and the bodies beyond it: its own row A, B, C, and those that its motion requires.
def torque_rows(frame: Frame, axis: Axis, composite: Composite) -> list[Row]:
    """Return the vectors A, B and C, from which the derivatives of torques follow (see the module), for each rate of a
    joint.

    They are relative to the origin of the joint.
    """
    if frame.joint.about_z:
        return [torque_row(frame, axis, composite)]
    found = []
    for number, turns in unit_twists(frame.joint):
        row = _turning_row if turns else _sliding_row
        there = row(axis_along(axis, number), composite_along(composite, number))
        found.append(Row(*(from_z(v, number) for v in there)))
    return found


def torque_row(frame: Frame, axis: Axis, composite: Composite) -> Row:
    """Return the vectors A, B and C, from which the derivatives of the joint's torque follow (see the module).

    The joint has one rate. The vectors are relative to the origin of the joint.
    """
    rows = (frame.joint.turn(1.0), _turning_row), (frame.joint.slide(1.0), _sliding_row)
    parts = [_scaled_row(row(axis, composite), factor) for factor, row in rows if factor is not None]
    return parts[0] if len(parts) == 1 else Row(*(add(x, y) for x, y in zip(*parts, strict=True)))


def _scaled_row(row: Row, factor: float) -> Row:
    return Row(*(scale(v, factor) for v in row))


def _turning_row(axis: Axis, composite: Composite) -> Row:
    body, (p, _), _ = composite
    (hx, hy, _), (xx, yy, _, xy, xz, yz) = body.moment, body.second
    gx, gy, _ = axis.twice
    b = (
        xx * gx + xy * gy - p[0][2],
        xy * gx + yy * gy - p[1][2],
        xz * gx + yz * gy + (p[0][0] + p[1][1]),
    )
    return Row((-xz, -yz, xx + yy), b, (-hy, hx, 0.0))


def _sliding_row(axis: Axis, composite: Composite) -> Row:
    body, (_, first), _ = composite
    hx, hy, _ = body.moment
    mx, my, _ = add(first, scale(cross(axis.w, body.moment), 2.0))
    return Row((hy, -hx, 0.0), (my, -mx, 0.0), (0.0, 0.0, body.mass))


def wrenches_of_motions(
    frame: Frame, axis: Axis, composite: Composite, rates: Scalar
) -> list[tuple[Wrench, Wrench]]:
    """Return, for each rate of a joint, the two wrenches that `wrenches_of_motion` returns for a joint with one rate.

    rates  rates of the joint
    """
    if frame.joint.about_z:
        return [wrenches_of_motion(frame, axis, composite)]
    found = []
    own = combined(frame.joint, rates)
    for number, turns in unit_twists(frame.joint):
        there = axis_along(axis, number), composite_along(composite, number)
        moved, pushed = (_turned_wrench, _turning_wrench) if turns else (_slid_wrench, _sliding_wrench)
        first, second = ((from_z(f, number), from_z(m, number)) for f, m in (moved(*there), pushed(*there)))
        bent = momentum_of(composite.body, bending(own, number, turns))
        found.append((first, (add(second[0], bent[0]), add(second[1], bent[1]))))
    return found


def wrenches_of_motion(frame: Frame, axis: Axis, composite: Composite) -> tuple[Wrench, Wrench]:
    """Return the wrenches on all bodies that a joint carries, per unit change of the joint's q and of its qd.

    They are the derivatives of the wrench that the bodies' motion requires.
    """
    turning = frame.joint.turn(1.0), _turned_wrench, _turning_wrench
    sliding = frame.joint.slide(1.0), _slid_wrench, _sliding_wrench
    parts = [
        (_scaled(moved(axis, composite), factor), _scaled(pushed(axis, composite), factor))
        for factor, moved, pushed in (turning, sliding)
        if factor is not None
    ]
    if len(parts) == 1:
        return parts[0]
    (a, b), (c, d) = parts
    return (add(a[0], c[0]), add(a[1], c[1])), (add(b[0], d[0]), add(b[1], d[1]))


def _scaled(wrench: Wrench, factor: float) -> Wrench:
    return scale(wrench[0], factor), scale(wrench[1], factor)


def _turned_wrench(axis: Axis, composite: Composite) -> Wrench:
    """Differentiate the wrench of a + U r + 2 w x r' + r'' as the composite rotates about z: z x h takes the place of
    h."""
    (_, (hx, hy, _), (xx, yy, _, xy, xz, yz)), (second, first), (force, moment) = composite
    (pxx, pxy, pxz), (pyx, pyy, pyz), (pzx, pzy, _) = second
    (wx, wy, wz), (u, differences) = axis.w, axis.spin
    h, p = (-hy, hx, 0.0), (-first[1], first[0], 0.0)
    whole = add(add(transform(u, h), cross(axis.w, p)), (-force[1], force[0], 0.0))
    gap, double = xx - yy, xy + xy
    spun = (
        u[2][0] * gap + u[2][1] * double + u[1][0] * yz + differences[0] * xz,
        u[0][1] * xz + u[2][0] * double - u[2][1] * gap - differences[1] * yz,
        differences[2] * gap - double * (u[1][0] + u[0][1]) - u[1][2] * yz - u[0][2] * xz,
    )
    across, along = pxy + pyx, pxx - pyy
    drifting = (
        across * wx - along * wy + pzy * wz,
        -(along * wx) - across * wy - pzx * wz,
        pyz * wx - pxz * wy,
    )
    lifted = add(cross(h, axis.acceleration), (-moment[1], moment[0], 0.0))
    return whole, add(add(spun, drifting), lifted)


def _turning_wrench(axis: Axis, composite: Composite) -> Wrench:
    """2 w x (z x h) + z x p and (tr P - P^T) z - 2 z x S w, P and p the composite's momenta."""
    (_, (hx, hy, _), (xx, yy, _, xy, xz, yz)), ((px, py, pz), first), _ = composite
    x, y, z = add(axis.w, axis.w)
    force = (-(hx * z) - first[1], first[0] - hy * z, hx * x + hy * y)
    sx, sy = xx * x + xy * y + xz * z, xy * x + yy * y + yz * z
    return force, (sy - pz[0], -sx - pz[1], px[0] + py[1])


def _slid_wrench(axis: Axis, composite: Composite) -> Wrench:
    """m z'' and h x z'' + z x F, F the whole force."""
    body, (_, first), (force, _) = composite
    whole = add(scale(axis.acceleration, body.mass), transform(axis.spin.field, body.moment))
    whole = add(add(whole, cross(axis.w, first)), force)
    return scale(axis.bend, body.mass), add(cross(body.moment, axis.bend), (-whole[1], whole[0], 0.0))


def _sliding_wrench(axis: Axis, composite: Composite) -> Wrench:
    """2 m z' and 2 h x z'"""
    body = composite.body
    return scale(axis.twice, body.mass), cross(body.moment, axis.twice)
