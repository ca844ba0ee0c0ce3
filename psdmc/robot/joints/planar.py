"""The planar joint, which moves in the xy plane and turns about the z axis of the joint frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from psdmc.robot.joints.joint_type import SLIDES, TURNS, Rows, Scalar, Twist, Vector, WideJoint
from psdmc.robot.joints.quaternion import arc
from psdmc.robot.joints.scalars import TINY, root, sign, sincos, square_of, unit


class Planar(WideJoint):
    """The planar joint. q is x and y (m), and the cosine and sine of the angle about z.

    Rates are the velocity of the moved frame's origin (m/s) and the angular velocity about z (rad/s). The velocity is
    along the x and y axes of the moved frame.
    """

    __slots__ = ()

    word: ClassVar[str] = "planar"
    urdf_words: ClassVar[tuple[str, ...]] = ("planar",)
    only_axis: ClassVar[tuple[float, float, float] | None] = (0.0, 0.0, 1.0)
    nq: ClassVar[int] = 4
    nv: ClassVar[int] = 3
    coordinates: ClassVar[str] = (
        "q: x y (m), cosine and sine of the angle"
        "; rates: velocity along its own x and y (m/s), angular velocity (rad/s)"
        "; efforts: force (N) and moment (N m)"
    )
    q_names: ClassVar[tuple[str, ...]] = ("x", "y", "cos", "sin")
    v_names: ClassVar[tuple[str, ...]] = ("vx", "vy", "wz")
    neutral: ClassVar[tuple[float, ...]] = (0.0, 0.0, 1.0, 0.0)
    unit: ClassVar[slice] = slice(2, 4)
    twists: ClassVar[tuple[Twist, ...]] = (SLIDES[0], SLIDES[1], TURNS[2])
    verb: ClassVar[str] = "moves in a plane"
    pinocchio: ClassVar[str] = "Planar"
    mujoco: ClassVar[str] = "none"

    def rotation(self, q: Sequence[Scalar]) -> Rows:
        c, s = q[2], q[3]
        return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))

    def displacement(self, q: Sequence[Scalar]) -> Vector:
        return (q[0], q[1], 0.0)

    def integrated(self, q: Sequence[Scalar], step: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return q after one second at constant rates.

        The origin moves on a circular arc. The displacement is the linear velocity times sin(h)/h, rotated by h, where
        h is half of the angle of rotation.
        """
        (x, y, *pair), (vx, vy, angle) = q, step
        c, s = unit(pair)
        half_s, half_c, share = _half(angle)
        dx, dy = share * (half_c * vx - half_s * vy), share * (half_s * vx + half_c * vy)
        turn_c, turn_s = half_c * half_c - half_s * half_s, 2.0 * half_s * half_c
        cosine, sine = c * turn_c - s * turn_s, s * turn_c + c * turn_s
        return (x + (c * dx - s * dy), y + (s * dx + c * dy), *unit((cosine, sine)))

    def difference(self, q: Sequence[Scalar], other: Sequence[Scalar]) -> tuple[Scalar, ...]:
        (x, y, c, s), (x1, y1, c1, s1) = q, other
        sine = c * (s1 - s) - s * (c1 - c)  # not c s1 - s c1, which loses the digits of a small angle
        # The angle from -pi to pi, rad. By the cosine's and the sine's sizes it is at most a quarter turn, which `arc`
        # finds exactly.
        cosine = c * c1 + s * s1
        length = 1.0 / root(cosine * cosine + sine * sine)
        ahead = sign(cosine)
        near = ahead * length * sine * arc(sine * sine * length * length, ahead * length * cosine)
        angle = near + (0.5 * math.pi) * (1.0 - ahead) * sign(sine)
        half_s, half_c, share = _half(angle)
        dx, dy = (c * (x1 - x) + s * (y1 - y)) / share, (c * (y1 - y) - s * (x1 - x)) / share
        return (half_c * dx + half_s * dy, half_c * dy - half_s * dx, angle)

    def coordinate_rates(self, q: Sequence[Scalar], rates: Sequence[Scalar]) -> tuple[Scalar, ...]:
        (_, _, c, s), (vx, vy, w) = q, rates
        return (c * vx - s * vy, s * vx + c * vy, -(s * w), c * w)

    def rates_bent(
        self, q: Sequence[Scalar], rates: Sequence[Scalar], motion: Sequence[Scalar]
    ) -> tuple[Scalar, ...]:
        (_, _, c, s), (vx, vy, w), turn = q, rates, motion[2]
        turned = -(turn * w)
        return (-turn * (s * vx + c * vy), turn * (c * vx - s * vy), turned * c, turned * s)

    def tangent(self, q: Sequence[Scalar], moved: Sequence[Scalar]) -> tuple[Scalar, ...]:
        (_, _, *pair), (dx, dy, dc, ds) = q, moved
        (c, s), square = unit(pair), square_of(pair)
        return (c * dx + s * dy, c * dy - s * dx, (pair[0] * ds - pair[1] * dc) / square)


def _half(angle: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """sin(h), cos(h) and sin(h)/h of half the angle, h."""
    half = 0.5 * angle
    sine, cosine = sincos(half)
    return sine, cosine, (sine * half + TINY) / (half * half + TINY)


PLANAR = Planar()
