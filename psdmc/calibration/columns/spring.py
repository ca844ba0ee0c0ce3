"""The effect of a spring in a fit: its tension at a reference length, its stiffness, and the friction of its rod."""

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
    """Return the tension per unit of a constant force that shortens the spring."""
    return np.ones_like(length)


def push(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of a constant force that lengthens the spring."""
    return -np.ones_like(length)


def stretch(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of stiffness: it grows with the length, and is zero at the reference length."""
    return length - reference


def rub(length: Array, rate: Array, reference: float) -> Array:
    """Return the tension per unit of rod friction, which acts against the motion of the rod."""
    return np.asarray(np.tanh(rate / SLIDING))


Law = Callable[[Array, Array, float], Array]
"""The tension per unit of a value, of length (N,), its rate (N,) and the reference length."""


@dataclass(frozen=True, slots=True, eq=False)
class Spring:
    """A spring in a fit. Its tension is the sum of unknown values times laws; motors balance it with tau = tension * d
    length / dq.

    laws       one function for each unknown value
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
