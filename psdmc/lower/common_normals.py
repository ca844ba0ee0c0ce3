"""Common normals of two axes: their feet and directions, and what takes their place where axes are nearly parallel."""

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
    """Whether two unit vectors along axes are parallel to within NEARLY_PARALLEL."""
    return float(np.linalg.norm(cross(a, b))) < NEARLY_PARALLEL


def foot_towards(point: Array, axis: Array, other_point: Array, other_axis: Array) -> Array | None:
    """Point of the line (point, axis) nearest to the other line; None where they are nearly parallel."""
    if nearly_parallel(axis, other_axis):
        return None
    normal = cross(axis, other_axis)
    square = times(normal, normal)
    along = times(cross(other_point - point, other_axis), normal) / square
    return np.asarray(point + along * axis)


def common_normal(axis: Array, following: Array, step: Array) -> Array | None:
    """Direction of the common normal of two axes; None where every perpendicular would do. For nearly parallel axes the
    step from one origin to the next takes its place."""
    normal = cross(axis, following)
    if nearly_parallel(axis, following):
        normal = perpendicular(step, axis)
        if np.linalg.norm(normal) < EXACT:
            return None
    return clean_direction(normal / length(normal))


def normal_on_side_of(axis: Array, following: Array, step: Array, x: Array) -> Array:
    """The common normal of a body's axis and a further child's, on the side of x; x where every perpendicular would do: the
    body's own x looks along the normal to its first child."""
    own = common_normal(axis, following, step)
    if own is None:
        return x
    return -own if times(own, x) < -EXACT else own


def across(direction: Array, axis: Array) -> Array:
    """The part of a unit direction across an axis; the direction itself where nearly all of it is across."""
    along = times(axis, direction)
    return direction if abs(along) < EXACT else clean_direction(direction - along * axis)


def perpendicular(vector: Array, axis: Array) -> Array:
    """The part of a vector across a unit axis, at right angles to it even where little is left."""
    part = vector - axis * times(axis, vector)
    if length(part) < LITTLE * length(vector):
        part = part - axis * times(axis, part)
    return np.asarray(part)
