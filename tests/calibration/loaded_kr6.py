"""An independent plant for tests of loads: the KR6 with a body appended, torques by Pinocchio, friction by its formula."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from bundled import bundled_robot

from psdmc.robot.reference import reference


@dataclass(frozen=True)
class Motion:
    """(N,) time; (N, 6) q, qd, qdd: four sines a joint."""

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray


def sines(
    rng: np.random.Generator,
    seconds: float,
    amplitude: float = 0.2,
    joints: Sequence[int] = range(6),
    quick: float = 1.0,
) -> Motion:
    """Of 0.5 to 4 rad/s times `quick`, each of `amplitude` rad, at 100 Hz; joints that are not named rest."""
    time = np.arange(0.0, seconds, 0.01)
    rates, starts = quick * rng.uniform(0.5, 4.0, (4, 6)), rng.uniform(0.0, 6.0, (4, 6))
    size = np.where(np.isin(np.arange(6), joints), amplitude, 0.0)
    turning = np.einsum("t,kj->tkj", time, rates) + starts
    q, qd = size * np.sin(turning).sum(axis=1), size * (rates * np.cos(turning)).sum(axis=1)
    return Motion(time, q, qd, -size * (rates**2 * np.sin(turning)).sum(axis=1))


def motor_torques(motion: Motion, load: pin.Inertia | None = None) -> np.ndarray:
    """(N, 6) N m, with that load on the tip."""
    robot = reference(bundled_robot("kr6"))
    if load is not None:
        tip = robot.model.frames[robot.model.getFrameId(robot.tip_name)]
        robot.model.appendBodyToJoint(tip.parentJoint, load, tip.placement)
    q, qd = motion.q, motion.qd
    rigid = robot.inverse_dynamics(q, qd, motion.qdd)
    return np.asarray(rigid + np.tanh(qd / 0.03) * (2.0 + np.abs(qd)) + 0.5)
