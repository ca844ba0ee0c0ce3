"""Computes a robot's geometry in extended precision, with rotations that are orthonormal to all digits.

The rotations in a file are orthonormal to 1e-16 only. Torque terms that should cancel then leave a remainder of
relative size 1e-16. This remainder would hide the effect of a small angle, such as 1e-8 rad between two nearly parallel
axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.derivation.units import Scaled
from psdmc.dynamics.frames import Frame
from psdmc.dynamics.scalar import Vector
from psdmc.reproducible import times

Long = NDArray[Any]
"""An array of np.longdouble: 64 bits of mantissa on x86, 113 on most Arm, 53 where the C library has no more."""

STEPS = 2
"""Steps of Newton's iteration, each of which squares the distance from a rotation."""


SMALL = 1e-3
"""A direction cosine, or a length in the robot's unit, below this gives coefficients of very different sizes when it is
multiplied by itself. Examples are right angles that a file rounds, tilts of calibrated axes and offsets of a tenth
of a millimetre."""


MANY_SCALES = 1e-2
"""A joint that moves nothing farther away than this, in the robot's unit of length, has coefficients of 1e-4 and less,
whose differences matter: thresholds for robots of one size would lose digits of its torque."""


class LongPlacement(NamedTuple):
    """A placement in extended precision."""

    rotation: Long
    translation: Long


def orthonormal(rotation: NDArray[np.float64]) -> Long:
    """Return the rotation nearest to a (3, 3) rotation of doubles, in extended precision. If the rotation maps a
    coordinate axis to a coordinate axis, its zeros stay exact."""
    near = rotation.astype(np.longdouble)
    three = 3.0 * np.eye(3, dtype=np.longdouble)
    for _ in range(STEPS):
        near = 0.5 * times(near, three - times(near.T, near))
    return np.asarray(near)


def extended(robot: Scaled) -> Scaled:
    """Return the robot with frames, link frames and the vertical in extended precision."""
    up = np.array(robot.up, dtype=np.longdouble)
    strength = np.sqrt(times(up, up))
    return replace(
        robot,
        frames=tuple(_frame(frame) for frame in robot.frames),
        link_frames=tuple(
            LongPlacement(orthonormal(place.rotation), place.translation.astype(np.longdouble))
            for place in robot.link_frames
        ),
        up=_vector(up / strength if strength else up),
    )


def _frame(frame: Frame) -> Frame:
    rotation = orthonormal(np.array(frame.rotation))
    translation = np.array(frame.translation, dtype=np.longdouble)
    first, second, third = (_vector(row) for row in rotation)
    return replace(frame, rotation=(first, second, third), translation=_vector(translation))


def _vector(values: Sequence[Any] | Long) -> Vector:
    x, y, z = values
    return (x, y, z)


def has_small_entries(robot: Scaled) -> bool:
    """Whether an angle or a length is small and not zero, so that double precision cannot distinguish its effects from
    rounding."""
    entries = [np.array([*frame.rotation, frame.translation]) for frame in robot.frames]
    entries += [np.vstack([place.rotation, place.translation]) for place in robot.link_frames]
    sizes = np.abs(np.stack([*entries, np.broadcast_to(robot.up, (4, 3))]))
    return bool(np.any((sizes > 0.0) & (sizes < SMALL)))


def is_of_many_scales(robot: Scaled) -> bool:
    """Return whether some joint moves only lengths that are tiny compared with the robot, but not all zero.

    An example is a finger of millimetres on an arm of metres. The result is also true if all lengths are tiny compared
    with the motion of sliding joints.
    """
    if robot.unit < MANY_SCALES and any(joint.length_order for joint in robot.types):
        return True
    reach = [_length(place.translation) for place in robot.link_frames]
    for k, frame in reversed(list(enumerate(robot.frames))):
        if frame.parent >= 0:
            reach[frame.parent] = max(reach[frame.parent], reach[k], _length(frame.translation))
    return any(0.0 < far < MANY_SCALES for far in reach)


def _length(translation: Sequence[Any] | Long) -> float:
    return math.hypot(*(float(x) for x in translation))
