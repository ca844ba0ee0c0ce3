"""The torques of a spring in a fit. The unknown values are the tension at a reference length, the stiffness, and the
friction of the spring's rod."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.columns.effect import Motion, Unknown
from psdmc.calibration.columns.ways import Way
from psdmc.calibration.logs.log import Array

SLIDING = 0.01
"""m/s (rad/s) over which a spring's friction changes sign."""


def pull(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of an unknown constant force that shortens the spring: one at every sample."""
    return np.ones_like(length)


def push(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of an unknown constant force that lengthens the spring: minus one at every sample."""
    return -np.ones_like(length)


def stretch(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of stiffness: the length of the spring minus the reference length, at every sample."""
    return length - reference


def rub(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of rod friction, which acts against the motion of the rod. It is about one while the
    spring becomes longer, minus one while it becomes shorter."""
    return np.asarray(np.tanh(rate / SLIDING))


Law = Callable[[Array, Array, float], Array]
"""The tension per unit of a value, of length (N,), its rate (N,) and the reference length."""


@dataclass(frozen=True, slots=True, eq=False)
class Spring:
    """A spring in a fit. Its tension is a sum of unknown values, each times a law. The motors balance the spring with
    the joint torques tau = tension * d length / dq.

    unknowns   the unknown values, such as the stiffness
    laws       for each unknown value, the function that returns the tension per unit
    way        function of the joint positions that returns the length of the spring
    reference  m (rad), the length at which `force` is the whole tension
    """

    unknowns: tuple[Unknown, ...]
    laws: tuple[Law, ...]
    way: Way
    reference: float
    by_load: bool = False

    def columns(self, motion: Motion) -> Array:
        length, slopes = self.way.length(motion.q)
        rate = np.sum(slopes * motion.qd, axis=1)
        tension = np.stack([law(length, rate, self.reference) for law in self.laws], axis=-1)
        return np.asarray(slopes[:, :, None] * tension[:, None, :])
