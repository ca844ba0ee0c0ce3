"""The free joint, with six degrees of freedom. It connects a floating base to the world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from psdmc.robot.joints.joint_type import SLIDES, TURNS, Rows, Scalar, Twist, Vector, WideJoint
from psdmc.robot.joints.quaternion import (
    angles_between,
    inverse,
    rates_bent,
    rates_of,
    rotation_of,
    turned_by,
    turning,
)
from psdmc.robot.joints.scalars import TINY, sign, square_of, unit


class Free(WideJoint):
    """The free joint. q is the position (m) and a unit quaternion (x, y, z, w).

    Rates are the velocity of the moved frame's origin (m/s) and the angular velocity (rad/s), both along the axes of
    the moved frame. Efforts are the force and the moment about the origin of the moved frame.
    """

    __slots__ = ()

    word: ClassVar[str] = "free"
    urdf_words: ClassVar[tuple[str, ...]] = ("floating",)
    nq: ClassVar[int] = 7
    nv: ClassVar[int] = 6
    coordinates: ClassVar[str] = (
        "q: x y z (m), unit quaternion x y z w"
        "; rates: linear (m/s) and angular velocity (rad/s) along its own axes"
        "; efforts: force (N) and moment (N m)"
    )
    q_names: ClassVar[tuple[str, ...]] = ("x", "y", "z", "qx", "qy", "qz", "qw")
    v_names: ClassVar[tuple[str, ...]] = ("vx", "vy", "vz", "wx", "wy", "wz")
    neutral: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    unit: ClassVar[slice] = slice(3, 7)
    twists: ClassVar[tuple[Twist, ...]] = (*SLIDES, *TURNS)
    verb: ClassVar[str] = "moves freely"
    pinocchio: ClassVar[str] = "FreeFlyer"
    mujoco: ClassVar[str] = "free"

    def rotation(self, q: Sequence[Scalar]) -> Rows:
        return rotation_of(q[3:])

    def displacement(self, q: Sequence[Scalar]) -> Vector:
        return (q[0], q[1], q[2])

    def integrated(self, q: Sequence[Scalar], step: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return q after one second at constant rates: velocity v and angular velocity w.

        Let t be the angle of w. The origin moves, along the axes of the moved frame at the start, by v + (1 - cos t) /
        t^2 w x v + (t - sin t) / t^3 w x (w x v).
        """
        linear, angles, here = step[:3], step[3:], unit(q[3:])
        turned, share, cosine = turned_by(here, angles)
        across = _cross(angles, linear)
        twice = _cross(angles, across)
        first = 0.5 * share * share
        second = (1.0 - share * cosine) / (square_of(angles) + TINY)
        gone = [v + (first * a + second * b) for v, a, b in zip(linear, across, twice, strict=True)]
        moved = _inward(rotation_of(here), gone)
        nearer = sign(cosine)  # of the two quaternions for one turn that to the one before, as Pinocchio's
        return (*(p + d for p, d in zip(q[:3], moved, strict=True)), *(nearer * x for x in turned))

    def difference(self, q: Sequence[Scalar], other: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """Return the constant rates, velocity v and angular velocity w, that lead from q to `other` in one second.

        Let the origin move by p along the axes of the moved frame at the start, and let t be the angle of w. Then v = p
        - w x p / 2 + (1 - t/2 cot(t/2)) / t^2 w x (w x p).
        """
        angles, cotangent = angles_between(q[3:], other[3:])
        apart = [there - here for here, there in zip(q[:3], other[:3], strict=True)]
        moved = _inward(rotation_of(inverse(q[3:])), apart)
        across = _cross(angles, moved)
        twice = _cross(angles, across)
        share = (1.0 - cotangent) / (square_of(angles) + TINY)
        linear = (p + (share * b - 0.5 * a) for p, a, b in zip(moved, across, twice, strict=True))
        return (*linear, *angles)

    def coordinate_rates(self, q: Sequence[Scalar], rates: Sequence[Scalar]) -> tuple[Scalar, ...]:
        return (*_inward(rotation_of(q[3:]), rates[:3]), *rates_of(q[3:], rates[3:]))

    def rates_bent(
        self, q: Sequence[Scalar], rates: Sequence[Scalar], motion: Sequence[Scalar]
    ) -> tuple[Scalar, ...]:
        turned = _inward(rotation_of(q[3:]), _cross(motion[3:], rates[:3]))
        return (*turned, *rates_bent(q[3:], rates[3:], motion[3:]))

    def tangent(self, q: Sequence[Scalar], moved: Sequence[Scalar]) -> tuple[Scalar, ...]:
        back = rotation_of(inverse(unit(q[3:])))
        return (*_inward(back, moved[:3]), *turning(q[3:], moved[3:]))


def _cross(a: Sequence[Scalar], b: Sequence[Scalar]) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _inward(rows: Rows, v: Sequence[Scalar]) -> Vector:
    x, y, z = (row[0] * v[0] + row[1] * v[1] + row[2] * v[2] for row in rows)
    return (x, y, z)


FREE = Free()
