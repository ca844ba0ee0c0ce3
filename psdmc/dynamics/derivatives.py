"""Derivatives of inverse dynamics by recursion: d tau / d q, d tau / d qd, and M = d tau / d qdd on the way.

Move joint j a little: every point x of the bodies beyond it goes to x + z_j x (x - o_j) (revolute) or x + z_j (prismatic).
With dots for time derivatives along the motion, z' = w x z and z'' = U z of the body before the joint, and the bodies
beyond joint i as one composite, this asks of joint i <= ... of joint i beyond j the additional torque

    d tau_i / d q_j   = A_i . z_j'' + B_i . z_j' + C_i . (a_j x z_j)
    d tau_i / d qd_j  = 2 A_i . z_j' + B_i . z_j
    M_ij              = A_i . z_j

where, with t_i the motion of the composite's points under unit rate of joint i and r their places from o_j,
A_i = int r x t_i dm, B_i = 2 int r' x t_i dm, C_i = int t_i dm; for a prismatic joint j, C_i takes the place of A_i and
nothing else counts. Joints before i feel what the motion of joint i asks of the composite: two wrenches, whose components
along their axes are the rest of the matrices. Rows and wrenches are carried from the tip to the base.

Carpentier, Mansard 2018 and Singh, Russell, Wensing 2022 have the same derivatives in spatial vectors; here they stand on
the pseudo-inertia, beside which a composite carries its momenta relative to the link before its joint. Everything of a
joint is written in the orientation before it turns; of parallel neighbours (`compound`) before the first of them turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from psdmc.dynamics.body import Body, in_previous, joined, shifted, turned
from psdmc.dynamics.frames import Frame, Turn, inward, joint_angle, to_previous
from psdmc.dynamics.motion import PLAIN, Choices, Forward, Rates, Spin, spin_of, sweep_outward
from psdmc.dynamics.scalar import (
    ZERO,
    Matrix,
    Scalar,
    Vector,
    add,
    cross,
    dot,
    multiply,
    scale,
    transform,
    transpose,
)

Rows = tuple[tuple[Scalar, ...], ...]


class Derivatives(NamedTuple):
    """n x n each: entry [i][j] = d tau_i / d q_j, d tau_i / d qd_j, d tau_i / d qdd_j = M_ij."""

    by_q: Rows
    by_qd: Rows
    by_qdd: Rows


class Momenta(NamedTuple):
    """How a composite moves relative to a link: 2 int r r'^T dm (rows: r) and 2 int r' dm, r' the velocity seen there."""

    second: Matrix
    first: Vector


NO_MOMENTA = Momenta((ZERO, ZERO, ZERO), ZERO)


class Axis(NamedTuple):
    """How the body before a joint moves, in the joint's orientation.

    w             rad/s, its angular velocity
    spin          its U, so that its points at r accelerate with acceleration + U r
    acceleration  m/s^2, of the joint's origin as one of its points
    rate, twice   z' = w x z and 2 z'
    """

    w: Vector
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


class Wrench(NamedTuple):
    force: Vector
    moment: Vector


NO_WRENCH = Wrench(ZERO, ZERO)


class Composite(NamedTuple):
    """All bodies from a joint on, about its origin in its orientation, moving relative to the link before the joint.

    momenta  2 int r r'^T dm and 2 int r' dm
    wrench   int r'' dm and int r x r'' dm
    """

    body: Body
    momenta: Momenta
    wrench: Wrench


class Row(NamedTuple):
    """The functional A . alpha + B . beta + C . gamma of a joint, about the point that it has been carried to."""

    a: Vector
    b: Vector
    c: Vector


@dataclass(frozen=True, slots=True)
class Step:
    """The way from a joint's orientation and origin to those of the joint before it.

    joins   whether both share an orientation, as parallel neighbours do
    offset  m, this origin from the one before; velocity: twice its rate of change (m/s). In the shared orientation,
            else along the axes of the link before
    turn    the turn of the joint before, or of its group up to it
    """

    frame: Frame
    joins: bool
    offset: Vector
    velocity: Vector
    turn: Turn | None

    def to_link(self, v: Vector) -> Vector:
        """A vector along the axes in which `offset` is written."""
        return v if self.joins else to_previous(self.frame, v)

    def to_orientation(self, v: Vector) -> Vector:
        """From there into the orientation of the joint before."""
        return v if self.joins else inward(self.turn, v)

    def carried(self, wrench: Wrench) -> Wrench:
        force = self.to_link(wrench.force)
        moment = add(self.to_link(wrench.moment), cross(self.offset, force))
        return Wrench(self.to_orientation(force), self.to_orientation(moment))

    def carried_row(self, row: Row) -> Row:
        c = self.to_link(row.c)
        a = add(self.to_link(row.a), cross(self.offset, c))
        b = add(self.to_link(row.b), cross(self.velocity, c))
        return Row(self.to_orientation(a), self.to_orientation(b), self.to_orientation(c))


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
    """Derivatives of the joint torques by q, qd and qdd; arguments as those of `inverse_dynamics`."""
    n = len(frames)
    forward = sweep_outward(frames, q, qd, qd, qdd, base, choices)
    axes, steps = _geometry(frames, qd, qdd, base, forward, choices)
    by_q, by_qd, by_qdd = ([[0.0] * n for _ in range(n)] for _ in range(3))
    beyond: Composite | None = None
    for i in reversed(range(n)):
        composite = _composite(i, frames, bodies, q, qd, qdd, forward, choices, beyond, steps)
        _row(i, frames, axes, steps, composite, by_q, by_qd, by_qdd)
        _column(i, frames, axes, steps, composite, by_q, by_qd)
        by_qdd[i][i] = by_qdd[i][i] + drive_inertia[i]
        beyond = composite
    return Derivatives(*(tuple(tuple(row) for row in rows) for rows in (by_q, by_qd, by_qdd)))


def _geometry(
    frames: Sequence[Frame],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base: Vector,
    forward: Forward,
    choices: Choices,
) -> tuple[list[Axis], list[Step]]:
    """Each joint's axis, and its step to the joint before."""
    axes: list[Axis] = []
    steps: list[Step] = []
    w, dw = ZERO, ZERO
    for i, frame in enumerate(frames):
        joins = choices.compound and i > 0 and frame.is_parallel
        offset = forward.states[i].offset
        turn = forward.compound_turns[i - 1] if i > 0 else None
        before = (
            base
            if i == 0
            else add(
                forward.motions[i - 1].acceleration, transform(forward.motions[i - 1].spin.field, offset)
            )
        )
        if joins:
            rate = qd[i - 1] if frames[i - 1].kind == "revolute" else 0.0
            speed_up = qdd[i - 1] if frames[i - 1].kind == "revolute" else 0.0
            dw = (dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + speed_up)
            w = (w[0], w[1], w[2] + rate)
            acceleration, offset = inward(turn, before), inward(turn, offset)
            slide: Vector = (0.0, 0.0, qd[i])
            velocity = cross(w, offset)
        else:
            rates = forward.rates[i - 1] if i > 0 else None
            link_w = rates.w if rates else ZERO
            w = _from_link(frame, link_w)
            dw = _from_link(frame, rates.dw_r) if rates else ZERO
            acceleration = _from_link(frame, before)
            slide = scale(transpose(frame.rotation)[2], qd[i])
            velocity = cross(link_w, offset)
        if frame.kind == "prismatic":
            velocity = add(velocity, slide)
        steps.append(Step(frame, joins, offset, scale(velocity, 2.0), turn))
        axes.append(_axis(w, dw, acceleration))
    return axes, steps


def _axis(w: Vector, dw: Vector, acceleration: Vector) -> Axis:
    wx, wy, _ = w
    return Axis(w, spin_of(Rates(w, w, dw)), acceleration, (wy, -wx, 0.0), (wy + wy, -(wx + wx), 0.0))


def _from_link(frame: Frame, v: Vector) -> Vector:
    return v if frame.is_parallel else transform(transpose(frame.rotation), v)


def _composite(
    i: int,
    frames: Sequence[Frame],
    bodies: Sequence[Body],
    q: Sequence[Scalar],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    forward: Forward,
    choices: Choices,
    beyond: Composite | None,
    steps: Sequence[Step],
) -> Composite:
    """Bodies from joint i on: its own body, and the composite beyond the next joint."""
    turn = forward.compound_turns[i]
    if beyond is None:
        angle = joint_angle(frames[i], q[i])
        double = (angle + angle).turn() if choices.fold_double_angle else None
        body = turned(bodies[i], forward.states[i].turn, double)
        if steps[i].joins:
            body = turned(body, steps[i].turn)
        return _driven(frames[i], Composite(body, NO_MOMENTA, NO_WRENCH), qd[i], qdd[i])
    step = steps[i + 1]
    if step.joins:
        whole = _with_own(turned(bodies[i], turn), beyond, step.offset)
    else:
        whole = _turned(_with_own(bodies[i], _in_link(step.frame, beyond), step.offset), turn)
    return _driven(frames[i], whole, qd[i], qdd[i])


def _with_own(own: Body, beyond: Composite, offset: Vector) -> Composite:
    """A link's own body, which rests in it, and a composite about a point that is `offset` away."""
    (second, first), (force, moment) = beyond.momenta, beyond.wrench
    rows = tuple(add(row, scale(first, length)) for row, length in zip(second, offset, strict=True))
    return Composite(
        joined(own, shifted(beyond.body, offset)),
        Momenta(rows, first),  # type: ignore[arg-type]
        Wrench(force, add(moment, cross(offset, force))),
    )


def _in_link(frame: Frame, composite: Composite) -> Composite:
    """Along the axes of the link before."""
    if frame.is_parallel:
        return composite
    second, first = composite.momenta
    second = multiply(multiply(frame.rotation, second), transpose(frame.rotation))
    wrench = Wrench(*(to_previous(frame, v) for v in composite.wrench))
    return Composite(in_previous(frame, composite.body), Momenta(second, to_previous(frame, first)), wrench)


def _turned(composite: Composite, turn: Turn | None) -> Composite:
    """Seen from before a turn about z."""
    if turn is None:
        return composite
    wrench = Wrench(*(turn.inward(v) for v in composite.wrench))
    return Composite(turned(composite.body, turn), _turned_momenta(composite.momenta, turn), wrench)


def _turned_momenta(momenta: Momenta, turn: Turn) -> Momenta:
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = momenta.second
    square, product = turn.sine * turn.sine, turn.sine * turn.cosine
    difference, total = xx - yy, xy + yx
    moved = square * difference + product * total
    crossed = product * difference - square * total
    xz, yz, _ = turn.inward((xz, yz, 0.0))
    zx, zy, _ = turn.inward((zx, zy, 0.0))
    second = ((xx - moved, xy + crossed, xz), (yx + crossed, yy + moved, yz), (zx, zy, zz))
    return Momenta(second, turn.inward(momenta.first))


def _driven(frame: Frame, composite: Composite, qd: Scalar, qdd: Scalar) -> Composite:
    """Relative to the link before the joint: what moves relative to the link of the joint, and that link's own motion,
    qd z x r and (qdd z x + qd^2 z x z x) r + 2 qd z x r'."""
    body, (second, first), (force, moment) = composite
    twice, (hx, hy, hz), (x, y, z) = qd + qd, body.moment, second
    if frame.kind == "prismatic":
        rows = (_plus_z(x, twice * hx), _plus_z(y, twice * hy), _plus_z(z, twice * hz))
        wrench = Wrench(_plus_z(force, body.mass * qdd), add(moment, (hy * qdd, -(hx * qdd), 0.0)))
        return Composite(body, Momenta(rows, _plus_z(first, twice * body.mass)), wrench)
    xx, yy, _, xy, xz, yz = body.second
    square, (px, py, _) = qd * qd, first
    force = (
        force[0] - (qd * py + qdd * hy + square * hx),
        force[1] + (qd * px + qdd * hx - square * hy),
        force[2],
    )
    moment = (
        moment[0] - (qd * z[0] + qdd * xz - square * yz),
        moment[1] - (qd * z[1] + qdd * yz + square * xz),
        moment[2] + (qd * (x[0] + y[1]) + qdd * (xx + yy)),
    )
    rows = (_plus_xy(x, twice, xx, xy), _plus_xy(y, twice, xy, yy), _plus_xy(z, twice, xz, yz))
    return Composite(body, Momenta(rows, _plus_xy(first, twice, hx, hy)), Wrench(force, moment))


def _plus_z(v: Vector, value: Scalar) -> Vector:
    return (v[0], v[1], v[2] + value)


def _plus_xy(v: Vector, rate: Scalar, x: Scalar, y: Scalar) -> Vector:
    """v + rate z x (x, y, .)"""
    return (v[0] - rate * y, v[1] + rate * x, v[2])


def _row(
    i: int,
    frames: Sequence[Frame],
    axes: Sequence[Axis],
    steps: Sequence[Step],
    composite: Composite,
    by_q: list[list[Scalar]],
    by_qd: list[list[Scalar]],
    by_qdd: list[list[Scalar]],
) -> None:
    """What joint i feels of the motion of joints j <= i."""
    row = _functional(frames[i], axes[i], composite)
    for j in reversed(range(i + 1)):
        axis = axes[j]
        if frames[j].kind == "revolute":
            by_q[i][j] = dot(row.a, axis.bend) + dot(row.b, axis.rate) + dot(row.c, axis.lever)
            by_qd[i][j] = dot(row.a, axis.twice) + row.b[2]
            by_qdd[i][j] = by_qdd[j][i] = row.a[2]
        else:
            by_q[i][j] = dot(row.c, axis.bend)
            by_qd[i][j] = dot(row.c, axis.twice)
            by_qdd[i][j] = by_qdd[j][i] = row.c[2]
        if j > 0:
            row = steps[j].carried_row(row)


def _functional(frame: Frame, axis: Axis, composite: Composite) -> Row:
    """A, B and C of the joint that carries the composite, about its own origin."""
    body, momenta = composite.body, composite.momenta
    hx, hy, _ = body.moment
    if frame.kind == "prismatic":
        mx, my, _ = add(momenta.first, scale(cross(axis.w, body.moment), 2.0))
        return Row((hy, -hx, 0.0), (my, -mx, 0.0), (0.0, 0.0, body.mass))
    xx, yy, _, xy, xz, yz = body.second
    p = momenta.second
    gx, gy, _ = axis.twice
    b = (
        xx * gx + xy * gy - p[0][2],
        xy * gx + yy * gy - p[1][2],
        xz * gx + yz * gy + (p[0][0] + p[1][1]),
    )
    return Row((-xz, -yz, xx + yy), b, (-hy, hx, 0.0))


def _column(
    i: int,
    frames: Sequence[Frame],
    axes: Sequence[Axis],
    steps: Sequence[Step],
    composite: Composite,
    by_q: list[list[Scalar]],
    by_qd: list[list[Scalar]],
) -> None:
    """What joints j < i feel of the motion of joint i."""
    find = _slid if frames[i].kind == "prismatic" else _spun
    moved, driven = find(axes[i], composite)
    for j in reversed(range(i)):
        moved, driven = steps[j + 1].carried(moved), steps[j + 1].carried(driven)
        if frames[j].kind == "revolute":
            by_q[j][i], by_qd[j][i] = moved.moment[2], driven.moment[2]
        else:
            by_q[j][i], by_qd[j][i] = moved.force[2], driven.force[2]


def _slid(axis: Axis, composite: Composite) -> tuple[Wrench, Wrench]:
    """Wrenches per unit of q and of qd of a prismatic joint: m z'', h x z'' + z x F; 2 m z', 2 h x z'."""
    body, (_, first) = composite.body, composite.momenta
    force = add(scale(axis.acceleration, body.mass), transform(axis.spin.field, body.moment))
    force = add(add(force, cross(axis.w, first)), composite.wrench.force)
    moment = add(cross(body.moment, axis.bend), (-force[1], force[0], 0.0))
    moved = Wrench(scale(axis.bend, body.mass), moment)
    return moved, Wrench(scale(axis.twice, body.mass), cross(body.moment, axis.twice))


def _spun(axis: Axis, composite: Composite) -> tuple[Wrench, Wrench]:
    """Wrenches per unit of q and of qd of a revolute joint.

    In q: what a + U r + 2 w x r' + r'' asks of the composite as it is turned about z, that is, with z x h for h and so on.
    In qd: 2 w x (z x h) + z x p and (tr P - P^T) z - 2 z x S w.
    """
    (_, (hx, hy, _), (xx, yy, _, xy, xz, yz)), (second, first), (force, moment) = composite
    (pxx, pxy, pxz), (pyx, pyy, pyz), (pzx, pzy, _) = second
    (wx, wy, wz), (u, differences), a = axis.w, axis.spin, axis.acceleration
    turned_h = (-hy, hx, 0.0)
    turned_p = (-first[1], first[0], 0.0)
    moved_force = add(add(transform(u, turned_h), cross(axis.w, turned_p)), (-force[1], force[0], 0.0))
    gap, double = xx - yy, xy + xy
    turning = (
        u[2][0] * gap + u[2][1] * double + u[1][0] * yz + differences[0] * xz,
        u[0][1] * xz + u[2][0] * double - u[2][1] * gap - differences[1] * yz,
        -(double * (u[1][0] + u[0][1])) - differences[2] * -gap - u[1][2] * yz - u[0][2] * xz,
    )
    across, along = pxy + pyx, pxx - pyy
    drifting = (
        across * wx - along * wy + pzy * wz,
        -(along * wx) - across * wy - pzx * wz,
        pyz * wx - pxz * wy,
    )
    moved_moment = add(add(turning, drifting), add(cross(turned_h, a), (-moment[1], moment[0], 0.0)))
    tx, ty, tz = wx + wx, wy + wy, wz + wz
    sw = (xx * tx + xy * ty + xz * tz, xy * tx + yy * ty + yz * tz)
    driven_force = add(turned_p, (-(hx * tz), -(hy * tz), hx * tx + hy * ty))
    driven = Wrench(driven_force, (sw[1] - pzx, -sw[0] - pzy, pxx + pyy))
    return Wrench(moved_force, moved_moment), driven
