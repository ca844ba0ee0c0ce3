"""Derivatives of inverse dynamics by recursion: d tau / d q, d tau / d qd, and M = d tau / d qdd on the way.

Turn joint j a little, and every point of the bodies beyond it goes along with t_j = z_j x r. Seen from these bodies, it is
the motion of the link before the joint that turns the other way. With z' = w x z and z'' = U z of that link and a the
acceleration of the joint's origin, this asks of a joint i beyond j (or j itself) the additional torque

    d tau_i / d q_j   = A_i . z_j'' + B_i . z_j' + C_i . (a_j x z_j)
    d tau_i / d qd_j  = 2 A_i . z_j' + B_i . z_j
    M_ij              = A_i . z_j

where A_i = int r x t_i dm, B_i = 2 int (dr/dt) x t_i dm and C_i = int t_i dm over the bodies beyond joint i, r from the
origin of joint j as a point of the link before it. Where joint j slides, C_i takes the place of A_i, and nothing else
counts. In turn, joints before i feel what the motion of joint i asks of the bodies beyond it: two wrenches, whose parts
along their axes are the rest of the matrices. Rows and wrenches are carried from each joint to the base.

Carpentier, Mansard 2018 and Singh, Russell, Wensing 2022 have the same derivatives in spatial vectors; here they stand on
the pseudo-inertia, and on composites that move (moving_composite.py): turned about z as a whole, these ask for what they
asked for before with z x h for h and so on. Everything of a joint is written in the orientation before it turns; of
parallel neighbours (`compound`) before the first of them turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from psdmc.dynamics.body import Body, turned
from psdmc.dynamics.frames import BASE, Frame, Turn, from_previous, inward, joint_angle, leaves, to_previous
from psdmc.dynamics.motion import PLAIN, Choices, Forward, Rates, Spin, spin_of, sweep_outward
from psdmc.dynamics.moving_composite import (
    Composite,
    along_parent,
    at_rest,
    before_turn,
    both,
    driven,
    moved_to,
)
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, dot, scale, transform, transpose
from psdmc.dynamics.twist import effort

Rows = tuple[tuple[Scalar, ...], ...]
Wrench = tuple[Vector, Vector]


class Derivatives(NamedTuple):
    """n x n each: entry [i][j] = d tau_i / d q_j, d tau_i / d qd_j, d tau_i / d qdd_j = M_ij."""

    by_q: Rows
    by_qd: Rows
    by_qdd: Rows


class Axis(NamedTuple):
    """How the link before a joint moves, in the joint's orientation.

    w             rad/s, its angular velocity; dw its derivative
    spin          its U, so that its points at r accelerate with acceleration + U r
    acceleration  m/s^2, of the joint's origin as one of its points
    rate, twice   z' = w x z and 2 z'
    """

    w: Vector
    dw: Vector
    spin: Spin
    acceleration: Vector
    rate: Vector
    twice: Vector

    @property
    def bend(self) -> Vector:
        """z'' = U z"""
        return transpose(self.spin.field)[2]

    @property
    def lever(self) -> Vector:
        """a x z"""
        return (self.acceleration[1], -self.acceleration[0], 0.0)


class Row(NamedTuple):
    """A, B and C of a joint, about the origin that they have been carried to."""

    a: Vector
    b: Vector
    c: Vector


@dataclass(frozen=True, slots=True)
class Step:
    """The way from a joint's orientation and origin to those of its parent.

    joins     whether both share an orientation, as parallel neighbours may
    offset    m, this origin from the parent's, and
    velocity  m/s, twice how that point of the parent's link moves about the parent's origin: both in the shared
              orientation, else along the axes of the parent's link
    turn      the turn of the parent, or of its group up to it
    slide     m/s, twice the rate at which the parent slides; None where it does not
    """

    frame: Frame
    joins: bool
    offset: Vector
    velocity: Vector
    turn: Turn | None
    slide: Scalar | None = None

    def to_link(self, v: Vector) -> Vector:
        """A vector along the axes in which `offset` is written."""
        return v if self.joins else to_previous(self.frame, v)

    def to_orientation(self, v: Vector) -> Vector:
        """From there into the parent's orientation."""
        return v if self.joins else inward(self.turn, v)

    def carried(self, wrench: Wrench) -> Wrench:
        force = self.to_link(wrench[0])
        moment = add(self.to_link(wrench[1]), cross(self.offset, force))
        return self.to_orientation(force), self.to_orientation(moment)

    def carried_row(self, row: Row) -> Row:
        c = self.to_link(row.c)
        a = add(self.to_link(row.a), cross(self.offset, c))
        b = add(self.to_link(row.b), cross(self.velocity, c))
        a, b, c = self.to_orientation(a), self.to_orientation(b), self.to_orientation(c)
        if self.slide is not None:
            b = (b[0] - self.slide * c[1], b[1] + self.slide * c[0], b[2])
        return Row(a, b, c)


def inverse_dynamics_derivatives(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    drive_inertia: Sequence[Scalar],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base: Vector,
    choices: Choices = PLAIN,
) -> Derivatives:
    """Derivatives of the joint torques by q, qd and qdd; arguments as those of `inverse_dynamics`.

    Exact zeros where neither joint carries the other.
    """
    n = len(frames)
    forward = sweep_outward(frames, q, qd, None, qdd, base, choices)
    axes: list[Axis] = []
    steps: list[Step] = []
    for i in range(n):
        axis, step = _geometry(i, frames, qd, qdd, base, forward, choices, axes)
        axes.append(axis)
        steps.append(step)
    by_q, by_qd, by_qdd = ([[0.0] * n for _ in range(n)] for _ in range(3))
    for i, composite in _composites(frames, bodies, q, qd, qdd, forward, choices, steps):
        _fill_row(i, frames, axes, steps, _row(frames[i], axes[i], composite), by_q, by_qd, by_qdd)
        _fill_column(i, frames, steps, _wrenches(frames[i], axes[i], composite), by_q, by_qd)
        by_qdd[i][i] = by_qdd[i][i] + drive_inertia[i]
    return Derivatives(*(tuple(tuple(row) for row in rows) for rows in (by_q, by_qd, by_qdd)))


def _geometry(
    i: int,
    frames: Sequence[Frame],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base: Vector,
    forward: Forward,
    choices: Choices,
    axes: Sequence[Axis],
) -> tuple[Axis, Step]:
    """A joint's axis, and its step to its parent."""
    frame, offset, parent = frames[i], forward.states[i].offset, frames[i].parent
    if parent == BASE:
        axis = _axis(ZERO, ZERO, from_previous(frame, base))
        return axis, Step(frame, False, offset, ZERO, None)
    turn, (acceleration, spin) = forward.compound_turns[parent], forward.motions[parent]
    before = add(acceleration, transform(spin.field, offset))
    joins = choices.compound and frame.is_parallel
    if joins:
        w, dw = _after(
            axes[parent], frames[parent].joint.turn(qd[parent]), frames[parent].joint.turn(qdd[parent])
        )
        before, offset = inward(turn, before), inward(turn, offset)
        velocity = cross(w, offset)
    else:
        rates = forward.rates[parent]
        w, dw = from_previous(frame, rates.w), from_previous(frame, rates.dw_r)
        before = from_previous(frame, before)
        velocity = cross(rates.w, offset)
    slide = frames[parent].joint.slide(qd[parent])
    twice = None if slide is None else slide + slide
    return _axis(w, dw, before), Step(frame, joins, offset, scale(velocity, 2.0), turn, twice)


def _after(axis: Axis, rate: Scalar | None, acceleration: Scalar | None) -> tuple[Vector, Vector]:
    """Angular velocity of the link behind a joint and its derivative, in the joint's orientation."""
    (w, dw) = axis.w, axis.dw
    if rate is None:
        return w, dw
    return (w[0], w[1], w[2] + rate), (dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + acceleration)


def _axis(w: Vector, dw: Vector, acceleration: Vector) -> Axis:
    wx, wy, _ = w
    twice = (wy + wy, -(wx + wx), 0.0)
    return Axis(w, dw, spin_of(Rates(w, dw)), acceleration, (wy, -wx, 0.0), twice)


def _composites(
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    forward: Forward,
    choices: Choices,
    steps: Sequence[Step],
) -> list[tuple[int, Composite]]:
    """Joint and composite beyond it, in the joint's orientation about its origin: children before parents."""
    found: list[tuple[int, Composite]] = []
    hung: list[list[Composite]] = [[] for _ in frames]
    joined_to: list[list[Composite]] = [[] for _ in frames]
    is_leaf = leaves(frames)
    for i in reversed(range(len(frames))):
        frame, step = frames[i], steps[i]
        whole = at_rest(bodies[i])
        if is_leaf[i]:
            whole = at_rest(_leaf(frame, bodies[i], q[i], forward.states[i].turn, step, choices))
        else:
            for child in hung[i]:
                whole = both(whole, child)
            whole = before_turn(whole, forward.compound_turns[i])
            for child in joined_to[i]:
                whole = both(whole, child)
        whole = driven(frame.joint, whole, qd[i], qdd[i])
        found.append((i, whole))
        if frame.parent != BASE and step.joins:
            joined_to[frame.parent].append(moved_to(whole, step.offset))
        elif frame.parent != BASE:
            hung[frame.parent].append(moved_to(along_parent(frame, whole), step.offset))
    return found


def _leaf(frame: Frame, body: Body, q: Scalar, turn: Turn | None, step: Step, choices: Choices) -> Body:
    """A body that carries no other, in its joint's orientation."""
    angle = joint_angle(frame, q)
    body = turned(body, turn, (angle + angle).turn() if choices.fold_double_angle else None)
    return turned(body, step.turn) if step.joins else body


def _fill_row(
    i: int,
    frames: Sequence[Frame],
    axes: Sequence[Axis],
    steps: Sequence[Step],
    row: Row,
    by_q: list[list[Scalar]],
    by_qd: list[list[Scalar]],
    by_qdd: list[list[Scalar]],
) -> None:
    """What joint i feels of the motion of joints from itself to the base."""
    j = i
    while True:
        joint, axis = frames[j].joint, axes[j]
        turning = dot(row.a, axis.bend) + dot(row.b, axis.rate) + dot(row.c, axis.lever)
        by_q[i][j] = effort(joint, (0.0, 0.0, dot(row.c, axis.bend)), (0.0, 0.0, turning))
        turning = dot(row.a, axis.twice) + row.b[2]
        by_qd[i][j] = effort(joint, (0.0, 0.0, dot(row.c, axis.twice)), (0.0, 0.0, turning))
        by_qdd[i][j] = by_qdd[j][i] = effort(joint, row.c, row.a)
        if frames[j].parent == BASE:
            return
        row, j = steps[j].carried_row(row), frames[j].parent


def _fill_column(
    i: int,
    frames: Sequence[Frame],
    steps: Sequence[Step],
    wrenches: tuple[Wrench, Wrench],
    by_q: list[list[Scalar]],
    by_qd: list[list[Scalar]],
) -> None:
    """What the joints before joint i feel of its motion."""
    (moved, pushed), j = wrenches, i
    while frames[j].parent != BASE:
        moved, pushed, j = steps[j].carried(moved), steps[j].carried(pushed), frames[j].parent
        by_q[j][i], by_qd[j][i] = effort(frames[j].joint, *moved), effort(frames[j].joint, *pushed)


def _row(frame: Frame, axis: Axis, composite: Composite) -> Row:
    """A, B and C of a joint about its own origin."""
    turn, slide = frame.joint.turn(1.0), frame.joint.slide(1.0)
    parts = []
    if turn is not None:
        parts.append(_scaled_row(_turning_row(axis, composite), turn))
    if slide is not None:
        parts.append(_scaled_row(_sliding_row(axis, composite), slide))
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


def _wrenches(frame: Frame, axis: Axis, composite: Composite) -> tuple[Wrench, Wrench]:
    """What a joint's motion asks of the composite, per unit of q and of qd."""
    turn, slide = frame.joint.turn(1.0), frame.joint.slide(1.0)
    parts = []
    if turn is not None:
        parts.append(
            (_scaled(_turned_wrench(axis, composite), turn), _scaled(_turning_wrench(axis, composite), turn))
        )
    if slide is not None:
        parts.append(
            (_scaled(_slid_wrench(axis, composite), slide), _scaled(_sliding_wrench(axis, composite), slide))
        )
    if len(parts) == 1:
        return parts[0]
    (a, b), (c, d) = parts
    return (add(a[0], c[0]), add(a[1], c[1])), (add(b[0], d[0]), add(b[1], d[1]))


def _scaled(wrench: Wrench, factor: float) -> Wrench:
    return scale(wrench[0], factor), scale(wrench[1], factor)


def _turned_wrench(axis: Axis, composite: Composite) -> Wrench:
    """What accelerations a + U r + 2 w x r' + r'' ask for, of the composite as it turns about z: with z x h for h and so
    on."""
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
