"""Differences of torques and matrices relative to their size, joint by joint."""

from __future__ import annotations

import numpy as np

from psdmc.robot.mechanism import Array

NO_TORQUE = 1e-9
"""Share of the largest torque below which a joint's torque is rounding."""


def worst(values: Array, expected: Array, bound: Array, share: float) -> tuple[float, float]:
    """Error and limit, `share` and bound, of the joint that uses most of it, both relative to its largest torque.

    values, expected  (states, nv);  bound  (nv,) what the errors may be beside `share` of the largest torque
    """
    scale = _scales(expected)
    error = np.abs(values - expected).max(axis=0)
    joint = int(np.argmax(error / (bound + share * scale)))
    return float(error[joint] / scale[joint]), float(bound[joint] / scale[joint]) + share


def relative_error(values: Array, expected: Array, least: float = 0.0) -> float:
    """Largest difference relative to the largest magnitude, joint by joint; a matrix as one.

    A joint that does less than NO_TORQUE of the largest torque, such as one with a vertical axis under
    gravity, is measured against that largest one; where all do less than `least`, against `least` / NO_TORQUE.
    """
    if expected.ndim == 3:
        return float(np.abs(values - expected).max()) / _largest(expected)
    return float((np.abs(values - expected).max(axis=0) / _scales(expected, least)).max())


def _largest(expected: Array) -> float:
    """The largest magnitude, never zero."""
    return max(float(np.abs(expected).max(initial=0.0)), float(np.finfo(float).tiny))


def _scales(expected: Array, least: float = 0.0) -> Array:
    """(nv,) scale that each joint's error is relative to."""
    overall = _largest(expected)
    if overall < least:
        return np.full(expected.shape[-1], least / NO_TORQUE)
    largest = np.abs(expected).max(axis=0)
    return np.where(largest > NO_TORQUE * overall, largest, overall)
