"""The motion to track: from rest to rest through a few poses inside the joints' limits, then a pause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POSES = 5
PAUSE = 1.0
"""s at the end: what is left of the error then is a steady one."""
SHARE = 0.4
"""Of the position range and of the speed limits that is used."""
WIDEST, FASTEST = 2.0, 2.0
"""Half range in rad (m), and speed in rad/s (m/s), where the robot file gives no limits."""
PEAK_SPEED = 1.875
"""Of a quintic from 0 to 1 in unit time."""


@dataclass(frozen=True, slots=True)
class Reference:
    """Position, velocity and acceleration of all joints, each (n,)."""

    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Quintics between poses (k, n), `duration` s each; velocity and acceleration vanish at the poses."""

    poses: Array
    duration: float

    @property
    def end(self) -> float:
        """s, the pause included."""
        return (len(self.poses) - 1) * self.duration + PAUSE

    def __call__(self, time: float) -> Reference:
        piece = min(int(time / self.duration), len(self.poses) - 2)
        s = min(time / self.duration - piece, 1.0)
        start, step = self.poses[piece], self.poses[piece + 1] - self.poses[piece]
        return Reference(
            start + step * (s**3 * (10 + s * (6 * s - 15))),
            step * (30 * s**2 * (1 - s) ** 2) / self.duration,
            step * (60 * s * (1 - s) * (1 - 2 * s)) / self.duration**2,
        )


def trajectory(lower: Array, upper: Array, speed: Array, seed: int = 4) -> Trajectory:
    """Poses drawn within the limits (n,), as fast as the slowest joint may go; infinite where there is no limit."""
    lower, upper = np.maximum(lower, -WIDEST), np.minimum(upper, WIDEST)
    middle, half = (upper + lower) / 2, SHARE * (upper - lower) / 2
    poses = middle + half * np.random.default_rng(seed).uniform(-1, 1, (POSES, len(lower)))
    allowed = SHARE * np.where(np.isfinite(speed), speed, FASTEST)
    duration = float(np.max(PEAK_SPEED * np.abs(np.diff(poses, axis=0)) / allowed))
    return Trajectory(poses, duration)
