"""The motion of the link before each joint, and the step from each joint to its parent, for the recursion of
derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from psdmc.dynamics.frames import BASE, Frame, Turn, about_z, from_previous, inward, outward, to_previous
from psdmc.dynamics.motion import Forward, Rates, Spin, spin_of
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, add, cross, scale, transform, transpose

Wrench = tuple[Vector, Vector]
"""Force and moment about an origin."""


class Axis(NamedTuple):
    """The motion of the link before a joint, in the joint's orientation.

    w, dw         rad/s, its angular velocity; rad/s^2, the derivative
    spin          its U, so that its points at r accelerate with acceleration + U r
    acceleration  m/s^2, of the joint's origin as one of its points
    rate, twice   z' = w x z and 2 z'
    up            m/s^2, the base's acceleration, minus gravity
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
    """A, B and C of a joint, about the origin that they have been carried to."""

    a: Vector
    b: Vector
    c: Vector


@dataclass(frozen=True, slots=True)
class Step:
    """The step from a joint's orientation and origin to those of its parent.

    joins     whether both share an orientation, as parallel neighbours may
    offset    m, this origin from the parent's, and
    velocity  m/s, twice the velocity of that point of the parent's link about the parent's origin; both are in the shared
              orientation, or else along the axes of the parent's link
    turn      the turn of the parent, or of its group of parallel axes up to it
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
        """A vector along those axes, in the parent's orientation."""
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


def axis_and_step(
    i: int,
    frames: Sequence[Frame],
    qd: Sequence[Scalar],
    qdd: Sequence[Scalar],
    base_acceleration: Vector,
    forward: Forward,
    axes: Sequence[Axis],
) -> tuple[Axis, Step]:
    """A joint's axis, and its step to its parent."""
    frame, offset, parent = frames[i], forward.states[i].offset, frames[i].parent
    if parent == BASE:
        up = from_previous(frame, base_acceleration)
        axis = _axis(ZERO, ZERO, up, up)
        return axis, Step(frame, False, offset, ZERO, None)
    turn, (acceleration, spin) = about_z(forward.compound_turns[parent]), forward.motions[parent]
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
        w, dw = from_previous(frame, rates.w), from_previous(frame, rates.dw_r)
        before = from_previous(frame, before)
        up = from_previous(frame, outward(turn, axes[parent].up))
        velocity = cross(rates.w, offset)
    slide = frames[parent].joint.slide(qd[parent])
    twice = None if slide is None else slide + slide
    return _axis(w, dw, before, up), Step(frame, joins, offset, scale(velocity, 2.0), turn, twice)


def _after(axis: Axis, rate: Scalar | None, acceleration: Scalar | None) -> tuple[Vector, Vector]:
    """Angular velocity of the link beyond a joint and its derivative, in the joint's orientation."""
    (w, dw) = axis.w, axis.dw
    if rate is None:
        return w, dw
    return (w[0], w[1], w[2] + rate), (dw[0] + w[1] * rate, dw[1] - w[0] * rate, dw[2] + acceleration)


def _axis(w: Vector, dw: Vector, acceleration: Vector, up: Vector) -> Axis:
    wx, wy, _ = w
    twice = (wy + wy, -(wx + wx), 0.0)
    return Axis(w, dw, spin_of(Rates(w, dw)), acceleration, (wy, -wx, 0.0), twice, up)
