"""Computes rotation matrices from angles and quaternions."""

from __future__ import annotations

import numpy as np

from psdmc.reproducible import cosine, sine, times
from psdmc.robot.mechanism import Array
from psdmc.robot.snap import snap_rotation


def about(axis: int, angle: float) -> Array:
    """Return the matrix (3, 3) of a rotation by `angle` (rad) about the x, y or z axis; `axis` is 0, 1 or 2."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = cosine(angle)
    rotation[j, i] = sine(angle)
    rotation[i, j] = -rotation[j, i]
    return rotation


def roll_pitch_yaw(angles: tuple[float, float, float], snap: float = 0.0) -> Array:
    """Return the rotation matrix (3, 3) Rz(yaw) Ry(pitch) Rx(roll). Each of the three rotations is snapped (a near
    right angle becomes exact) separately, because the file rounds each angle separately.

    angles, snap   rad
    """
    roll, pitch, yaw = (snap_rotation(about(axis, angle), snap)[0] for axis, angle in enumerate(angles))
    return np.asarray(times(times(yaw, pitch), roll))


def from_quaternion(x: float, y: float, z: float, w: float) -> Array:
    """Return the rotation matrix (3, 3) of a unit quaternion, whose real part is w."""
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
