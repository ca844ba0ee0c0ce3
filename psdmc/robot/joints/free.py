"""A joint that leaves its body every motion: the root of a robot that stands, walks or flies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from psdmc.robot.joints.joint_type import SLIDES, TURNS, Rows, Scalar, Twist, Vector
from psdmc.robot.joints.quaternion import angles_between, of_length_one, rotation_of, turned_by
from psdmc.robot.joints.wide_joint import WideJoint
from psdmc.robot.placement import Array

SMALL = 1e-2
"""rad; below, the way that a turning frame goes comes from series, whose next term is below 1e-16."""


class Free(WideJoint):
    """q is the position (m) and a unit quaternion (x, y, z, w); rates are the velocity of the moved frame's origin (m/s) and
    its angular velocity (rad/s), both along its own axes. Efforts are the force and the moment about that origin."""

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
    neutral: ClassVar[tuple[float, ...]] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    twists: ClassVar[tuple[Twist, ...]] = (*SLIDES, *TURNS)
    verb: ClassVar[str] = "moves freely"
    pinocchio: ClassVar[str] = "FreeFlyer"
    mujoco: ClassVar[str] = "free"

    def rotation(self, q: Sequence[Scalar]) -> Rows:
        return rotation_of(q[3:])

    def way(self, q: Sequence[Scalar]) -> Vector:
        return (q[0], q[1], q[2])

    def normalized(self, q: Array) -> Array:
        return np.concatenate([q[:3], of_length_one(q[3:])])

    def integrated(self, q: Array, step: Array) -> Array:
        moved = _rotated(q[..., 3:], _gone(step[..., :3], step[..., 3:]))
        return np.concatenate([q[..., :3] + moved, turned_by(q[..., 3:], step[..., 3:])], axis=-1)

    def difference(self, q: Array, other: Array) -> Array:
        angles = angles_between(q[..., 3:], other[..., 3:])
        back = q[..., 3:] * np.array([-1.0, -1.0, -1.0, 1.0])
        return np.concatenate(
            [_straight(_rotated(back, other[..., :3] - q[..., :3]), angles), angles], axis=-1
        )


def _rotated(quaternion: Array, v: Array) -> Array:
    rows = rotation_of(np.moveaxis(quaternion, -1, 0))  # type: ignore[arg-type]
    return np.stack([(np.stack(row, axis=-1) * v).sum(axis=-1) for row in rows], axis=-1)


def _gone(linear: Array, angles: Array) -> Array:
    """Where a frame's origin comes that moves with constant rates of its own for one second, in the frame at the start:
    v + (1 - cos t) / t^2 w x v + (t - sin t) / t^3 w x (w x v), t the angle of w."""
    angle = np.linalg.norm(angles, axis=-1, keepdims=True)
    wide = np.where(angle > SMALL, angle, 1.0)
    square = angle**2
    first = np.where(angle > SMALL, (1.0 - np.cos(wide)) / wide**2, 0.5 - square / 24.0 + square**2 / 720.0)
    second = np.where(
        angle > SMALL, (wide - np.sin(wide)) / wide**3, 1.0 / 6.0 - square / 120.0 + square**2 / 5040.0
    )
    across = np.cross(angles, linear)
    return np.asarray(linear + first * across + second * np.cross(angles, across))


def _straight(moved: Array, angles: Array) -> Array:
    """The constant linear rates of a frame that comes to `moved` while it turns by `angles`; inverse of `_gone`:
    p - w x p / 2 + (1 / t^2 - (1 + cos t) / (2 t sin t)) w x (w x p)."""
    angle = np.linalg.norm(angles, axis=-1, keepdims=True)
    wide = np.where(angle > SMALL, angle, 1.0)
    tangent = (1.0 - wide / (2.0 * np.tan(0.5 * wide))) / wide**2
    share = np.where(angle > SMALL, tangent, 1.0 / 12.0 + angle**2 / 720.0 + angle**4 / 30240.0)
    across = np.cross(angles, moved)
    return np.asarray(moved - 0.5 * across + share * np.cross(angles, across))


FREE = Free()
