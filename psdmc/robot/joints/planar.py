"""A joint that moves in its xy plane and turns about its z."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from psdmc.robot.joints.joint_type import SLIDES, TURNS, Rows, Scalar, Twist, Vector
from psdmc.robot.joints.quaternion import of_length_one
from psdmc.robot.joints.wide_joint import WideJoint
from psdmc.robot.placement import Array

SMALL = 1e-2
"""rad; below, the way that a turning frame goes comes from series, whose next term is below 1e-16."""


class Planar(WideJoint):
    """q is x and y (m), cosine and sine of the angle about z; rates are the velocity of the moved frame's origin along its
    own x and y (m/s) and the angular velocity about z (rad/s)."""

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
    neutral: ClassVar[tuple[float, ...]] = (0.0, 0.0, 1.0, 0.0)
    twists: ClassVar[tuple[Twist, ...]] = (SLIDES[0], SLIDES[1], TURNS[2])
    verb: ClassVar[str] = "moves in a plane"
    pinocchio: ClassVar[str] = "Planar"
    mujoco: ClassVar[str] = "none"

    def rotation(self, q: Sequence[Scalar]) -> Rows:
        c, s = q[2], q[3]
        return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))

    def way(self, q: Sequence[Scalar]) -> Vector:
        return (q[0], q[1], 0.0)

    def normalized(self, q: Array) -> Array:
        return np.concatenate([q[:2], of_length_one(q[2:])])

    def integrated(self, q: Array, step: Array) -> Array:
        (vx, vy, angle), (x, y, c, s) = np.moveaxis(step, -1, 0), np.moveaxis(q, -1, 0)
        along, across = _shares(angle)
        dx, dy = along * vx - across * vy, across * vx + along * vy
        turned = of_length_one(
            np.stack([c * np.cos(angle) - s * np.sin(angle), s * np.cos(angle) + c * np.sin(angle)])
        )
        return np.stack([x + c * dx - s * dy, y + s * dx + c * dy, *turned], axis=-1)

    def difference(self, q: Array, other: Array) -> Array:
        (x, y, c, s), (x1, y1, c1, s1) = np.moveaxis(q, -1, 0), np.moveaxis(other, -1, 0)
        angle = np.arctan2(c * s1 - s * c1, c * c1 + s * s1)
        dx, dy = c * (x1 - x) + s * (y1 - y), c * (y1 - y) - s * (x1 - x)
        along, across = _shares(angle)
        square = along**2 + across**2
        return np.stack(
            [(along * dx + across * dy) / square, (along * dy - across * dx) / square, angle], axis=-1
        )


def _shares(angle: Array) -> tuple[Array, Array]:
    """sin t / t and (1 - cos t) / t"""
    is_wide = np.abs(angle) > SMALL
    wide, square = np.where(is_wide, angle, 1.0), angle**2
    along = np.where(is_wide, np.sin(wide) / wide, 1.0 - square / 6.0 + square**2 / 120.0)
    across = np.where(is_wide, (1.0 - np.cos(wide)) / wide, angle * (0.5 - square / 24.0 + square**2 / 720.0))
    return along, across


PLANAR = Planar()
