"""Writes placements and numbers as text. A program that reads the text gets exactly equal floats."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from psdmc.robot.placement import Array


def exact(values: Iterable[float]) -> str:
    """Return numbers as text with as many digits as are needed to read equal floats. Minus zero is written as zero."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def roll_pitch_yaw_of(rotation: Array) -> tuple[float, float, float]:
    """Return roll, pitch, yaw (rad) of Rz(yaw) Ry(pitch) Rx(roll). If the pitch is a right angle, roll is 0."""
    across = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], across)
    if across < QUARTER:
        return (0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1]))
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    return (roll, pitch, math.atan2(rotation[1, 0], rotation[0, 0]))


QUARTER = 1e-9
"""Cosine of the pitch below which roll and yaw turn about the same axis."""


def quaternion_of(rotation: Array) -> tuple[float, float, float, float]:
    """Return the unit quaternion (w, x, y, z) of a rotation, with w not negative.

    The largest component is computed first, so that no digits are lost.
    """
    r = rotation
    trace = float(np.trace(r))
    diagonal = [trace, float(r[0, 0]), float(r[1, 1]), float(r[2, 2])]
    k = int(np.argmax(diagonal))
    if k == 0:
        w = 1.0 + trace
        found = np.array([w, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    else:
        i = k - 1
        j, m = (i + 1) % 3, (i + 2) % 3
        found = np.zeros(4)
        found[0] = r[m, j] - r[j, m]
        found[1 + i] = 1.0 + 2.0 * r[i, i] - trace
        found[1 + j] = r[j, i] + r[i, j]
        found[1 + m] = r[m, i] + r[i, m]
    w, x, y, z = (found / np.linalg.norm(found)).tolist()
    return (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)
