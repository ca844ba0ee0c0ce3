"""Motions from rest into and out of a motion that starts or ends at speed."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.trajectory import Trajectory, limit_faults
from psdmc.errors import InputError
from psdmc.robot.mechanism import Mechanism

DURATIONS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
"""s, tried in this order until the limits are kept."""


def from_rest_to_rest(motion: Trajectory, chain: Mechanism) -> Trajectory:
    """The motion with a quintic before and after it, position, speed and acceleration continuous.

    InputError where no lead-in of up to 6 s keeps the limits.
    """
    before = _lead(motion, chain, motion.q[0], motion.qd[0], motion.qdd[0])
    after = _lead(motion, chain, motion.q[-1], -motion.qd[-1], motion.qdd[-1])
    q = np.vstack([before.q[:-1], motion.q, after.q[-2::-1]])
    qd = np.vstack([before.qd[:-1], motion.qd, -after.qd[-2::-1]])
    qdd = np.vstack([before.qdd[:-1], motion.qdd, after.qdd[-2::-1]])
    time: Array = np.arange(len(q), dtype=np.float64) * motion.period
    return Trajectory(motion.joint_names, time, q, qd, qdd, motion.sliding)


def _lead(motion: Trajectory, chain: Mechanism, q: Array, qd: Array, qdd: Array) -> Trajectory:
    """The motion from rest to a state; run backwards it leads from the mirrored state to rest."""
    low = np.array([joint.limits.lower for joint in chain.joints])
    high = np.array([joint.limits.upper for joint in chain.joints])
    for duration in DURATIONS:
        # half the distance that the final speed would cover: what an even acceleration needs
        start = np.clip(q - 0.5 * duration * qd, low, high)
        lead = _quintic(motion, start, q, qd, qdd, duration)
        if not limit_faults(lead, chain):
            return lead
    raise InputError(
        f"no lead-in of up to {DURATIONS[-1]:g} s keeps the limits of {', '.join(motion.joint_names)}",
        "leave more margin in the exciting motion",
    )


def _quintic(
    motion: Trajectory, start: Array, q: Array, qd: Array, qdd: Array, duration: float
) -> Trajectory:
    """q(s) = start + d3 s^3 + d4 s^4 + d5 s^5, s from 0 to 1: rest at first, the state at last."""
    count = round(duration / motion.period) + 1
    s = np.linspace(0.0, 1.0, count)[:, None]
    move, rate, bend = q - start, duration * qd, duration**2 * qdd
    d3 = 10 * move - 4 * rate + 0.5 * bend
    d4 = -15 * move + 7 * rate - bend
    d5 = 6 * move - 3 * rate + 0.5 * bend
    return Trajectory(
        motion.joint_names,
        s[:, 0] * duration,
        start + s**3 * (d3 + s * (d4 + s * d5)),
        s**2 * (3 * d3 + s * (4 * d4 + s * 5 * d5)) / duration,
        s * (6 * d3 + s * (12 * d4 + s * 20 * d5)) / duration**2,
        motion.sliding,
    )
