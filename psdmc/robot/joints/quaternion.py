"""Unit quaternions (x, y, z, w) for joints that turn about every axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.robot.joints.joint_type import Rows, Scalar
from psdmc.robot.placement import Array

SMALL = 1e-4
"""rad; below, sines and cosines of half an angle come from the first terms of their series: the next is below 1e-17."""


def rotation_of(quaternion: Sequence[Scalar]) -> Rows:
    """Rows of the rotation matrix, over abstract scalars; a rotation where the quaternion is of length one."""
    x, y, z, w = quaternion
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz, xy, xz, yz = x2 * x, y2 * y, z2 * z, y2 * x, z2 * x, z2 * y
    wx, wy, wz = x2 * w, y2 * w, z2 * w
    return (
        (1.0 - (yy + zz), xy - wz, xz + wy),
        (xy + wz, 1.0 - (xx + zz), yz - wx),
        (xz - wy, yz + wx, 1.0 - (xx + yy)),
    )


def turned_by(quaternion: Array, angles: Array) -> Array:
    """(..., 4) the quaternion (..., 4) after a turn about axes of its own frame by `angles` (..., 3) rad, of length one."""
    half = 0.5 * np.linalg.norm(angles, axis=-1, keepdims=True)
    wide = np.where(half > SMALL, half, 1.0)
    share = np.where(half > SMALL, np.sin(wide) / wide, 1.0 - half**2 / 6.0)
    step = np.concatenate([0.5 * share * angles, np.cos(half)], axis=-1)
    moved = _product(quaternion, step)
    return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True))


def angles_between(quaternion: Array, other: Array) -> Array:
    """(..., 3) rad: the turn about the first one's own axes that makes it the other, of half a turn at most."""
    step = _product(quaternion * np.array([-1.0, -1.0, -1.0, 1.0]), other)
    step = np.where(step[..., 3:] < 0.0, -step, step)
    sine, cosine = np.linalg.norm(step[..., :3], axis=-1, keepdims=True), step[..., 3:]
    wide = np.where(sine > SMALL, sine, 1.0)
    share = np.where(
        sine > SMALL, 2.0 * np.arctan2(wide, cosine) / wide, 2.0 / cosine * (1.0 - sine**2 / 3.0)
    )
    return np.asarray(share * step[..., :3])


def _product(a: Array, b: Array) -> Array:
    u, v, s, t = a[..., :3], b[..., :3], a[..., 3:], b[..., 3:]
    return np.concatenate(
        [s * v + t * u + np.cross(u, v), s * t - (u * v).sum(axis=-1, keepdims=True)], axis=-1
    )


def of_length_one(q: Array) -> Array:
    """(k, ...) divided by its length along the first axis, in the array's precision."""
    return np.asarray(q / np.sqrt((q * q).sum(axis=0)))
