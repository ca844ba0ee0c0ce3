"""Common normals of two joint axes: directions, and feet (the points where a normal meets the axes). Nearly parallel
axes have no unique normal, and another direction perpendicular to them is used."""

from __future__ import annotations

import numpy as np

from psdmc.lower.without_rounding import EXACT, clean_direction
from psdmc.reproducible import cross, length, times
from psdmc.robot.mechanism import Array

NEARLY_PARALLEL = 2e-2
"""Sine of the angle below which two axes are treated as parallel but for the rotation between them: their common
normal may lie kilometres away, and torques would be differences of huge numbers."""

LITTLE = 1e-2
"""Part of a vector across an axis below which rounding has changed its direction: it is made perpendicular once more."""


def nearly_parallel(a: Array, b: Array) -> bool:
    """Return whether two unit vectors are nearly parallel or opposite: the sine of their angle is less than
    NEARLY_PARALLEL."""
    return float(np.linalg.norm(cross(a, b))) < NEARLY_PARALLEL


def foot_towards(point: Array, axis: Array, other_point: Array, other_axis: Array) -> Array | None:
    """Return the point of a line that is nearest to another line; None if the lines are nearly parallel. A line is
    given by a point and a unit vector."""
    if nearly_parallel(axis, other_axis):
        return None
    normal = cross(axis, other_axis)
    square = times(normal, normal)
    along = times(cross(other_point - point, other_axis), normal) / square
    return np.asarray(point + along * axis)


def common_normal(axis: Array, following: Array, step: Array) -> Array | None:
    """Return the unit vector of the common normal of two axes, given by their directions. For nearly parallel axes, it
    is the part of `step` (from one origin to the next) that is perpendicular to them. Return None if this part is
    zero."""
    normal = cross(axis, following)
    if nearly_parallel(axis, following):
        normal = perpendicular(step, axis)
        if np.linalg.norm(normal) < EXACT:
            return None
    return clean_direction(normal / length(normal))


def normal_on_side_of(axis: Array, following: Array, step: Array, x: Array) -> Array:
    """Return the unit vector of the common normal of a body's axis and a child's axis. Of its two directions, the one
    nearer to x is chosen. Return x itself if the axes coincide. x is the body's x axis, along the normal to its first
    child."""
    own = common_normal(axis, following, step)
    if own is None:
        return x
    return -own if times(own, x) < -EXACT else own


def across(direction: Array, axis: Array) -> Array:
    """Return the part of a unit direction that is perpendicular to an axis, scaled to length one. If the part along the
    axis is only rounding, return the direction unchanged."""
    along = times(axis, direction)
    return direction if abs(along) < EXACT else clean_direction(direction - along * axis)


def perpendicular(vector: Array, axis: Array) -> Array:
    """Return the part of a vector that is perpendicular to a unit axis, even if this part is small."""
    part = vector - axis * times(axis, vector)
    if length(part) < LITTLE * length(vector):
        part = part - axis * times(axis, part)
    return np.asarray(part)
