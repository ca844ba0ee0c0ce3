"""Common normals of two joint axes: their feet (the points where they meet the axes) and directions. For nearly
parallel axes, other directions take their place."""

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
    """Whether the angle between two unit vectors, or one of them reversed, is less than NEARLY_PARALLEL."""
    return float(np.linalg.norm(cross(a, b))) < NEARLY_PARALLEL


def foot_towards(point: Array, axis: Array, other_point: Array, other_axis: Array) -> Array | None:
    """Return the point of the line (point, axis) that is nearest to the other line; None if the lines are nearly
    parallel."""
    if nearly_parallel(axis, other_axis):
        return None
    normal = cross(axis, other_axis)
    square = times(normal, normal)
    along = times(cross(other_point - point, other_axis), normal) / square
    return np.asarray(point + along * axis)


def common_normal(axis: Array, following: Array, step: Array) -> Array | None:
    """Return the direction of the common normal of two axes. For nearly parallel axes, it is that of the step from one
    origin to the next. None if every perpendicular direction would serve."""
    normal = cross(axis, following)
    if nearly_parallel(axis, following):
        normal = perpendicular(step, axis)
        if np.linalg.norm(normal) < EXACT:
            return None
    return clean_direction(normal / length(normal))


def normal_on_side_of(axis: Array, following: Array, step: Array, x: Array) -> Array:
    """Return the common normal of a body's axis and the axis of a further child, in the sense that is nearest to x. The
    result is x itself if every perpendicular direction would serve. The body's own x is along the normal to its first
    child."""
    own = common_normal(axis, following, step)
    if own is None:
        return x
    return -own if times(own, x) < -EXACT else own


def across(direction: Array, axis: Array) -> Array:
    """Return the part of a unit direction that is perpendicular to an axis; the direction itself if nearly all of it
    is."""
    along = times(axis, direction)
    return direction if abs(along) < EXACT else clean_direction(direction - along * axis)


def perpendicular(vector: Array, axis: Array) -> Array:
    """Return the part of a vector that is perpendicular to a unit axis, even if this part is small."""
    part = vector - axis * times(axis, vector)
    if length(part) < LITTLE * length(vector):
        part = part - axis * times(axis, part)
    return np.asarray(part)
