"""Converts a robot to a unit of length near the robot's size, so that one tolerance fits all torque coefficients.

The unit is a power of two in metres, so converting to it and back changes no bit of any number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import BASE, Follows, Frame, frames_of
from psdmc.dynamics.regressor import Placed
from psdmc.dynamics.scalar import Vector
from psdmc.reproducible import length
from psdmc.robot.inertia import LENGTH_ORDER
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array, Mechanism, Placement
from psdmc.robot.zeros import leading_rows


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
        if frame.follows is not None:
            own, (shares, offset) = frame.joint.length_order, frame.follows
            shares = tuple(
                (leader, ratio * unit ** (frames[leader].joint.length_order - own))
                for leader, ratio in shares
            )
            scaled = replace(scaled, follows=Follows(shares, offset / unit**own))
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
