"""For each joint, computes the motion of the link before it, and the change of axes and origin to the parent joint.

The recursion of derivatives (derivatives.py), which runs from the tips to the base, needs both.

Each rate of a joint with several coordinates, such as a spherical joint, is along or about one axis of the frame that
the joint moves. The formulas for a joint about z apply, with this axis in place of z. All vectors are along the axes
after the joint's rotation. One term is added, V x E: the joint's twist V rotates the unit twist E of each rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from psdmc.dynamics.frames import (
    BASE,
    Frame,
    Rotation,
    Turn,
    about_z,
    from_previous,
    inward,
    outward,
    to_previous,
)
from psdmc.dynamics.motion import Forward, Rates, Spin, spin_of
from psdmc.dynamics.moving_composite import Composite, Momenta
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, scale, transform, transpose
from psdmc.dynamics.spatial import Body, combined, efforts
from psdmc.robot.joints import JointType

Wrench = tuple[Vector, Vector]
"""Force and moment about an origin."""


class Axis(NamedTuple):
    """The motion of the link before a joint, along the joint's axes before its rotation.

    For a joint of several coordinates, the axes are those after the rotation.

    w, dw         rad/s, angular velocity of the link; rad/s^2, its derivative
    spin          has the matrix U: a point at r from the joint's origin accelerates with acceleration + U r
    acceleration  m/s^2, of the joint's origin as a point of the link
    rate, twice   w x z for the joint's axis z, and twice this vector
    up            m/s^2, acceleration of the base, minus gravity
    """

    w: Vector
    dw: Vector
    spin: Spin
    acceleration: Vector
    rate: Vector
    twice: Vector
    up: Vector

    @property
    def bend(self) -> Vector:
        """z'' = U z"""
        return transpose(self.spin.field)[2]

    @property
    def lever(self) -> Vector:
        """a x z"""
        return (self.acceleration[1], -self.acceleration[0], 0.0)


class Row(NamedTuple):
    """The vectors A, B and C that give the derivatives of a joint's torque (derivatives.py).

    They are relative to the origin of the joint that the recursion towards the base has reached.
    """

    a: Vector
    b: Vector
    c: Vector


@dataclass(frozen=True, slots=True)
class Step:
    """The change of axes and origin from a joint to its parent, in the recursion towards the base.

    The orientation of a joint is the set of axes in which its quantities are given (see derivatives.py). Joints with
    parallel axes can share one.

    joins     True: the joint and its parent share an orientation
    offset    m, this joint's origin relative to the parent's
    velocity  m/s, twice the velocity of this joint's origin as a point of the parent's link, relative to the parent's
              origin. `offset` and `velocity` are along the shared orientation, or else along the axes of the parent's
              link
    turn      rotation of the parent and of earlier joints with parallel axes; None if the parent has several
              coordinates, because its orientation is after its rotation
    slide     m/s, twice the rate at which the parent slides; None if it does not slide
    own       this joint's rotation, if the joint has several coordinates
    drift     m/s, twice the linear rates of the parent, if the parent has several coordinates
    """

    frame: Frame
    joins: bool
    offset: Vector
    velocity: Vector
    turn: Turn | None
    slide: Scalar | None = None
    own: Turn | Rotation | None = None
    drift: Vector | None = None

    def to_link(self, v: Vector) -> Vector:
        """Rotate the vector v from this joint's axes into the axes in which `offset` and `velocity` are given.

        These are the axes of the parent's link. But if this joint and its parent share an orientation (`joins`), they
        are the shared axes, and v is returned unchanged.
        """
        return v if self.joins else to_previous(self.frame, inward(self.own, v))

    def to_orientation(self, v: Vector) -> Vector:
        """Rotate the vector v from the axes in which `offset` and `velocity` are given into the parent joint's axes.

        If this joint and its parent share an orientation (`joins`), v is returned unchanged.
        """
        return v if self.joins else inward(self.turn, v)

    def to_parent(self, wrench: Wrench) -> Wrench:
        """Return a wrench about the parent's origin, along the axes in which `offset` is given."""
        force = self.to_link(wrench[0])
        return force, add(self.to_link(wrench[1]), cross(self.offset, force))

    def carried(self, wrench: Wrench) -> Wrench:
        force, moment = self.to_parent(wrench)
        return self.to_orientation(force), self.to_orientation(moment)

    def carried_row(self, row: Row) -> Row:
        c = self.to_link(row.c)
        a = add(self.to_link(row.a), cross(self.offset, c))
        b = add(self.to_link(row.b), cross(self.velocity, c))
        a, b, c = self.to_orientation(a), self.to_orientation(b), self.to_orientation(c)
        if self.slide is not None:
            b = (b[0] - self.slide * c[1], b[1] + self.slide * c[0], b[2])
        if self.drift is not None:
            b = add(b, cross(self.drift, c))
        return Row(a, b, c)


def axis_and_step(
    i: int,
    frames: Sequence[Frame],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base_acceleration: Vector,
    forward: Forward,
    axes: Sequence[Axis],
) -> tuple[Axis, Step]:
    """Return the motion of the link before joint i, and the change of axes and origin from joint i to its parent.

    qd, qdd            one value per joint; for a joint of several coordinates, a tuple
    base_acceleration  m/s^2, minus gravity
    axes               results for the joints before i
    """
    frame, offset, parent = frames[i], forward.states[i].offset, frames[i].parent
    own = None if frame.joint.about_z else forward.states[i].turn
    if parent == BASE:
        up = outward(own, from_previous(frame, base_acceleration))
        axis = axis_of(ZERO, ZERO, up, up)
        return axis, Step(frame, False, offset, ZERO, None, own=own)
    is_simple, (acceleration, spin) = frames[parent].joint.about_z, forward.motions[parent]
    turn = about_z(forward.compound_turns[parent]) if is_simple else None
    before = add(acceleration, transform(spin.field, offset))
    joins = forward.joins[i]
    if joins:
        w, dw = _after(
            axes[parent], frames[parent].joint.turn(qd[parent]), frames[parent].joint.turn(qdd[parent])
        )
        before, offset, up = inward(turn, before), inward(turn, offset), axes[parent].up
        velocity = cross(w, offset)
    else:
        rates = forward.rates[parent]
        w, dw = outward(own, from_previous(frame, rates.w)), outward(own, from_previous(frame, rates.dw_r))
        before = outward(own, from_previous(frame, before))
        up = outward(own, from_previous(frame, outward(turn, axes[parent].up)))
        velocity = cross(rates.w, offset)
    axis, velocity = axis_of(w, dw, before, up), scale(velocity, 2.0)
    if not is_simple:
        drift = scale(combined(frames[parent].joint, qd[parent])[0], 2.0)
        return axis, Step(frame, joins, offset, velocity, turn, own=own, drift=drift)
    slide = frames[parent].joint.slide(qd[parent])
    twice = None if slide is None else slide + slide
    return axis, Step(frame, joins, offset, velocity, turn, twice, own)


def _after(axis: Axis, rate: Scalar | None, acceleration: Scalar | None) -> tuple[Vector, Vector]:
    """Angular velocity of the link beyond a joint and its derivative, in the joint's orientation."""
    (w, dw) = axis.w, axis.dw
    if rate is None:
        return w, dw
    return (w[0], w[1], w[2] + rate), (dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + acceleration)


def axis_of(w: Vector, dw: Vector, acceleration: Vector, up: Vector) -> Axis:
    """Return an Axis, the motion of the link before a joint, from vectors along the joint's axes.

    w, dw         rad/s, rad/s^2, angular velocity of the link, and its derivative
    acceleration  m/s^2, of the joint's origin as a point of the link
    up            m/s^2, acceleration of the base, minus gravity
    """
    wx, wy, _ = w
    twice = (wy + wy, -(wx + wx), 0.0)
    return Axis(w, dw, spin_of(Rates(w, dw)), acceleration, (wy, -wx, 0.0), twice, up)


Vectors = tuple[Vector, Vector]
"""A linear and an angular one."""


def unit_twists(joint: JointType) -> list[tuple[int, bool]]:
    """Return one pair per joint rate: the number of the axis (0, 1, 2 for x, y, z), and whether the rate is a rotation
    about this axis."""
    places = [(*linear, *angular).index(1.0) for linear, angular in joint.twists]
    return [(place % 3, place >= 3) for place in places]


def to_z(v: Vector, axis: int) -> Vector:
    """Permute the entries x, y, z of a vector cyclically so that the given axis becomes z."""
    return (v[(axis + 1) % 3], v[(axis + 2) % 3], v[axis])


def from_z(v: Vector, axis: int) -> Vector:
    """Back."""
    return to_z(v, (1 - axis) % 3)


def axis_along(axis: Axis, number: int) -> Axis:
    """Return the motion of the link before a joint, with the entries of all vectors permuted so that the axis `number`
    becomes z."""
    vectors = (to_z(v, number) for v in (axis.w, axis.dw, axis.acceleration, axis.up))
    return axis_of(*vectors)


def composite_along(composite: Composite, number: int) -> Composite:
    """Return a composite (several bodies as one) with the entries of all vectors permuted so that the axis `number`
    becomes z."""
    body, (second, first), (force, moment) = composite
    xx, yy, zz, xy, xz, yz = body.second
    squares, products = to_z((xx, yy, zz), number), to_z((yz, xz, xy), number)
    turned = Body(body.mass, to_z(body.moment, number), (*squares, products[2], products[1], products[0]))
    rows = to_z((second[0], second[1], second[2]), number)
    a, b, c = (to_z(row, number) for row in rows)
    return Composite(
        turned, Momenta((a, b, c), to_z(first, number)), (to_z(force, number), to_z(moment, number))
    )


def bending(own: Vectors, number: int, turns: bool) -> Vectors:
    """Compute V x E, linear and angular: the change of a rate's unit twist E by the joint's motion V.

    own     V, the joint's linear and angular velocity
    number  axis of E: 0, 1, 2 for x, y, z
    turns   whether E is a rotation about the axis; otherwise E is a motion along the axis
    """
    (u, s), e = own, (float(number == 0), float(number == 1), float(number == 2))
    return (cross(u, e), cross(s, e)) if turns else (cross(s, e), ZERO)


def by_own_axes(
    joint: JointType, axis: Axis, row: Row, rates: Scalar
) -> tuple[tuple[Scalar, ...], tuple[Scalar, ...], tuple[Scalar, ...]]:
    """Compute the derivatives of one torque by the positions, the rates and the accelerations of one joint with several
    coordinates.

    row  the vectors (A, B, C) of the torque; the module docstring of derivatives.py defines them
    """
    (a, b, c), (u, s) = row, combined(joint, rates)
    field = transpose(axis.spin.field)
    turning = add(transform(field, a), add(cross(b, axis.w), cross(c, axis.acceleration)))
    by_q = efforts(joint, transform(field, c), turning)
    bent = add(scale(axis.w, 2.0), s)
    by_qd = efforts(joint, cross(c, bent), add(add(cross(a, bent), b), cross(c, u)))
    return by_q, by_qd, efforts(joint, c, a)
