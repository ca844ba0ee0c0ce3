"""A spring along a way: a force at a reference length, a rate, and friction of its rod."""

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
    """A force that shortens the spring."""
    return np.ones_like(length)


def push(length: Array, rate: Array, reference: float) -> Array:
    """A force that lengthens it."""
    return -np.ones_like(length)


def stretch(length: Array, rate: Array, reference: float) -> Array:
    """A force that grows with the length, shortening it; equally one that pushes and grows as it is shortened."""
    return length - reference


def rub(length: Array, rate: Array, reference: float) -> Array:
    """Friction of the rod against its motion."""
    return np.asarray(np.tanh(rate / SLIDING))


Law = Callable[[Array, Array, float], Array]
"""The tension per unit of a value, of length (N,), its rate (N,) and the reference length."""


@dataclass(frozen=True, slots=True, eq=False)
class Spring:
    """The tension is the sum over laws of value times law, and the motors hold against it: tau = tension * d length / dq.

    laws       one for each unknown
    reference  m (rad), where `force` is the whole tension
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
