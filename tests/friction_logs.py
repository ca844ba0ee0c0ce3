"""Logs of an arm of two joints with friction: Pinocchio's torques on sums of sines, the friction, and noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bundled import bundled_robot

from psdmc.calibration.logs.log import Log
from psdmc.robot.reference import reference

ROBOT = "two_link_full"
NOISE = 0.05
"""N m, standard deviation."""

Array = np.ndarray


def friction_log(seed: int, seconds: float, friction: Callable[[Array, Array], Array]) -> tuple[Log, Array]:
    """A log, and its accelerations (rows, 2). `friction` takes positions and rates."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 0.005)
    rates, starts = rng.uniform(1.0, 5.0, (5, 2)), rng.uniform(0.0, 6.0, (5, 2))
    turning = np.einsum("t,kj->tkj", time, rates) + starts
    q, qd = 0.22 * np.sin(turning).sum(axis=1), 0.22 * (rates * np.cos(turning)).sum(axis=1)
    qdd = -0.22 * (rates**2 * np.sin(turning)).sum(axis=1)
    robot = bundled_robot(ROBOT)
    torque = reference(robot).inverse_dynamics(q, qd, qdd) + friction(q, qd)
    torque += rng.normal(scale=NOISE, size=torque.shape)
    return Log("log", robot.mechanism.joint_names, time, q, qd, torque, "motor_torque"), qdd
