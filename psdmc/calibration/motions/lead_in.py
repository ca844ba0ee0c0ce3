"""A periodic motion run from rest to rest: it begins and ends on its own path, slower and slower towards the ends.

q(s(t)) with the path's own time s: speeds are s' times, accelerations s'^2 times the motion's, plus q' s''. No place is
visited that the motion does not visit, and for a ramp that is long enough whatever is left of the limits of
acceleration and torque is more than q' s'' takes: each motion that keeps its limits with a margin has such ramps.
(A quintic from another place to the motion's start need not exist: the start may lie near a limit of position and be
approached from beyond it.)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.sine_sum import SineSum
from psdmc.calibration.motions.trajectory import Trajectory
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

RAMPS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, *(12.0 * 2.0**k for k in range(7)))
"""s, tried in this order until the limits are kept: up to 13 minutes, for a motion that leaves 1 % of an acceleration
that is a hundredth of its speed."""

Faults = Callable[[Trajectory], list[str]]
"""What a motion may not do and does, a sentence each."""


def from_rest_to_rest(
    motion: SineSum, chain: Mechanism, period: float, repeats: int, faults: Faults
) -> Trajectory:
    """`repeats` periods of the motion with a ramp before and after them, rows `period` apart.

    InputError where no ramp keeps the limits.
    """
    found: list[str] = []
    for ramp in RAMPS:
        whole = ramped(motion, chain.joint_names, period, repeats, ramp)
        found = faults(whole)
        if not found:
            return whole
    raise InputError(
        f"the exciting motion cannot begin at rest within the limits: {'; '.join(found)}",
        "leave more of the limits: a smaller --margin or --torque-margin",
    )


def ramped(
    motion: SineSum, joint_names: tuple[str, ...], period: float, repeats: int, ramp: float
) -> Trajectory:
    """The motion with ramps of that many seconds, rounded to rows."""
    rows = max(round(ramp / period), 1)
    middle: Array = np.arange(round(repeats * motion.duration / period) + 1, dtype=np.float64) * period
    length = rows * period
    x: Array = np.arange(rows, dtype=np.float64) / rows
    gone, rate, bend = _smooth_step(x)
    way = gone * length - 0.5 * length
    end = middle[-1]
    path = np.concatenate([way, middle, end - way[::-1]])
    pace = np.concatenate([rate, np.ones(len(middle)), rate[::-1]])[:, None]
    change = np.concatenate([bend, np.zeros(len(middle)), -bend[::-1]])[:, None] / length
    q, qd, qdd = motion.at(path)
    time: Array = np.arange(len(path), dtype=np.float64) * period
    return Trajectory(joint_names, time, q, qd * pace, qdd * pace**2 + qd * change)


def _smooth_step(x: Array) -> tuple[Array, Array, Array]:
    """Integral, value and slope of 6 x^5 - 15 x^4 + 10 x^3."""
    return (
        x**4 * (2.5 + x * (x - 3.0)),
        x**3 * (10.0 + x * (6.0 * x - 15.0)),
        30.0 * x**2 * (1.0 - x) ** 2,
    )
