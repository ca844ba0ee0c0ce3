"""Removal of rounding errors from directions, lengths, rotations and placements. Numbers that are nearly zero, one or a
short decimal become exactly so."""

from __future__ import annotations

import numpy as np

from psdmc.reproducible import length
from psdmc.robot.mechanism import Array, Placement

EXACT = 4e-15
"""Lengths (relative to the chain's reach) and direction cosines below this are rounding of an exact zero: some units in the
last place. A small joint's torque may be a hundredth of what passes it by: 1e-12 here has been 1e-10 there."""

DECIMALS = 12
"""A length that differs by rounding from one of so many decimals is replaced by that one, so that equal lengths stay
equal. See ROUNDING."""

ROUNDING = 1e-15
"""What composing placements can move a length by, relative to the chain's reach. Rounded to decimals beyond this, lengths of
centimetres would lose digits."""


def without_rounding(place: Placement, reach: float) -> Placement:
    """Return a placement in which numbers that differ from zero or one only by rounding are exactly zero or one."""
    return Placement(exact_rotation(place.rotation), clean_lengths(place.translation, reach) + 0.0)


def clean_direction(direction: Array) -> Array:
    """Return the unit vector along a direction. Entries that are only rounding become zero."""
    cleaned = np.where(np.abs(direction) < EXACT, 0.0, direction)
    return np.asarray(cleaned / length(cleaned))


def clean_lengths(lengths: Array, scale: float) -> Array:
    """Return lengths without rounding errors. Lengths that are nearly zero become zero. Lengths that are nearly a short
    decimal become this decimal, so that equal lengths stay equal."""
    return _decimal(np.where(np.abs(lengths) < EXACT * scale, 0.0, lengths), scale)


def _decimal(lengths: Array, scale: float) -> Array:
    nearest = np.round(lengths, DECIMALS)
    return np.asarray(np.where(np.abs(nearest - lengths) <= ROUNDING * scale, nearest, lengths), np.float64)


def exact_rotation(rotation: Array) -> Array:
    """Return a rotation matrix in which entries that differ from zero or one only by rounding are exactly zero or
    one."""
    near = np.round(rotation)
    return np.asarray(np.where(np.abs(rotation - near) < EXACT, near, rotation) + 0.0)


def constant_rotation(rotation: Array) -> Array:
    """Return the constant rotation between two frames. It is a rotation about x and is made exactly so, unless the
    joint axes are nearly parallel."""
    turns_x = np.max(np.abs([*rotation[0, 1:], *rotation[1:, 0]])) > EXACT
    return rotation if turns_x else _about_x(rotation)


def _about_x(rotation: Array) -> Array:
    """The rotation about x nearest to this one, with exact zeros and ones."""
    c, s = float(rotation[1, 1]), float(rotation[2, 1])
    c, s = (0.0 if abs(v) < EXACT else v for v in (c, s))
    length = np.hypot(c, s)
    c, s = c / length, s / length
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
