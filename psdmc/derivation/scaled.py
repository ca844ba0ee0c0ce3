"""The robot as the derivation sees it: lengths in a unit near its size, in double or in extended precision.

One tolerance then fits all torque coefficients. The unit is a power of two in metres, so converting to it and back
changes no bit of any number.

The rotations in a file are orthonormal to 1e-16 only. Torque terms that should cancel then leave a remainder of
relative size 1e-16. This remainder would hide the effect of a small angle, such as 1e-8 rad between two nearly parallel
axes. In extended precision, rotations are orthonormal to all digits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import BASE, Frame, Mimic, frames_of
from psdmc.dynamics.regressor import Placed
from psdmc.dynamics.scalar import Vector
from psdmc.reproducible import length, times
from psdmc.robot.inertia import LENGTH_ORDER, leading_rows
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Mechanism, Placement

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


@dataclass(frozen=True, slots=True, eq=False)
class Scaled:
    """A robot in the form that the derivation uses: lengths in a unit near the robot's size.

    types, frames  joint types and joint frames
    link_frames    link frames in joint frames
    unit           m, the unit of length
    span           (11 n, k) matrix that computes the standard parameters of n links from the k parameters that the
                   assumptions leave
    leads          (k,) for each column of the span, the row of its leading one
    up             unit vector against gravity in the base frame; zero if there is no gravity
    """

    types: tuple[JointType, ...]
    frames: tuple[Frame, ...]
    link_frames: tuple[Placed, ...]
    unit: float
    span: Array
    leads: NDArray[np.int64]
    up: Vector


def scaled(chain: Mechanism) -> Scaled:
    """Return the robot in the form that the derivation uses: lengths in a unit near the size of the robot."""
    unit = length_unit(chain)
    units = parameter_units(chain.types, unit)
    leads = leading_rows(chain.parameter_span)
    span = chain.parameter_span / units[:, None] * units[leads]
    strength = length(np.asarray(chain.gravity))
    x, y, z = (-float(g) / strength if strength else 0.0 for g in chain.gravity)
    return Scaled(
        chain.types,
        frames_in_unit(frames_of(chain), unit),
        tuple(in_unit(joint.link_frame, unit) for joint in chain.joints),
        unit,
        span,
        leads,
        (x, y, z),
    )


def length_unit(chain: Mechanism) -> float:
    """Return the unit of length in metres: the power of two nearest to the longest step from joint to joint; one if all
    steps are zero."""
    steps = [
        math.hypot(*joint.placement.translation)
        for joint, parent in zip(chain.joints, chain.parents, strict=True)
        if parent != BASE
    ]
    steps += [math.hypot(*joint.link_frame.translation) for joint in chain.joints]
    longest = max(steps)
    return 2.0 ** round(math.log2(longest)) if longest > 0 else 1.0


def in_unit(placement: Placement, unit: float) -> Placement:
    """Return a placement with its translation (m) in another unit of length (m)."""
    return Placement(placement.rotation, placement.translation / unit)


def frames_in_unit(frames: Sequence[Frame], unit: float) -> tuple[Frame, ...]:
    """Return the joint frames with lengths in another unit: translations, and the data of mimic joints.

    These data are ratios and offsets to the leaders' positions, if a joint slides.

    unit  m
    """
    found = []
    for frame in frames:
        x, y, z = frame.translation
        scaled = replace(frame, translation=(x / unit, y / unit, z / unit))
        if frame.mimic is not None:
            own, (shares, offset) = frame.joint.length_order, frame.mimic
            shares = tuple(
                (leader, ratio * unit ** (frames[leader].joint.length_order - own))
                for leader, ratio in shares
            )
            scaled = replace(scaled, mimic=Mimic(shares, offset / unit**own))
        found.append(scaled)
    return tuple(found)


def parameter_units(types: Sequence[JointType], unit: float) -> Array:
    """(11 n,) the value of one unit of each standard parameter in SI, for a unit of length in metres."""
    drive = [joint.drive_order for joint in types]
    orders = np.column_stack([np.tile(LENGTH_ORDER, (len(types), 1)), drive])
    units: Array = unit ** orders.reshape(len(types) * PARAMETERS_PER_LINK).astype(np.float64)
    return units


def torque_units(types: Sequence[JointType], unit: float) -> Array:
    """(n,) the value of one unit of torque (force for sliding joints) in SI; the units of mass and time are SI's."""
    return np.array([unit**joint.effort_order for joint in types])


def monomial_units(exponents: NDArray[np.uint8], types: Sequence[JointType], unit: float) -> Array:
    """Return (p,) the value in SI of one unit of each monomial (product of joint variables) in the columns of E.

    Monomials without rates contain the strength of gravity |g|.

    exponents  (5n, p) E: exponents of the joint variables
    unit       m, the unit of length
    """
    n = len(types)
    orders = np.array([joint.length_order for joint in types])
    blocks = exponents.reshape(5, n, -1).astype(np.int64)
    lengths = (blocks[[0, 3, 4]] * orders[:, None]).sum(axis=(0, 1))
    is_gravity = ~blocks[3:].any(axis=(0, 1))
    units: Array = unit ** (lengths + is_gravity).astype(np.float64)
    return units


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
