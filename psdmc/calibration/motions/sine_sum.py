"""A periodic motion: a sum of sines per joint, (22) of Denso-2022."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.trajectory import Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class SineSum:
    """q_i(t) = centre_i + sum over k of a_ik sin(w_k t) + b_ik cos(w_k t), w_k = 2 pi harmonic_k / duration.

    centre (n,), sine (n, h), cosine (n, h): rad (m). As amplitude and phase: A sin(w t + phi), A = hypot(a, b).
    """

    duration: float
    harmonics: tuple[int, ...]
    centre: Array
    sine: Array
    cosine: Array

    @property
    def amplitude(self) -> Array:
        return np.hypot(self.sine, self.cosine)

    @property
    def phase(self) -> Array:
        return np.arctan2(self.cosine, self.sine)

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """(N, n) each: position, speed and acceleration at any times (N,)."""
        basis = sine_basis(self.harmonics, self.duration, time)
        q, qd, qdd = (self.sine @ s + self.cosine @ c for s, c in basis)
        return q.T + self.centre, qd.T, qdd.T

    def sampled(self, joint_names: tuple[str, ...], period: float, repeats: int = 1) -> Trajectory:
        """The motion on an even grid, `repeats` periods of it."""
        count = round(repeats * self.duration / period) + 1
        time: Array = np.arange(count, dtype=np.float64) * period
        return Trajectory(joint_names, time, *self.at(time))

    def shrunk(self, share: float) -> SineSum:
        """The motion with all amplitudes times `share`, about the same centre."""
        return replace(self, sine=share * self.sine, cosine=share * self.cosine)


def sine_basis(harmonics: tuple[int, ...], duration: float, time: Array) -> list[tuple[Array, Array]]:
    """(sine, cosine) rows (h, N) of position, speed and acceleration."""
    w = 2.0 * np.pi * np.array(harmonics)[:, None] / duration
    s, c = np.sin(w * time), np.cos(w * time)
    return [(s, c), (w * c, -w * s), (-(w**2) * s, -(w**2) * c)]
