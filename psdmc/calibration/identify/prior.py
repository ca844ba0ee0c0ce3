"""Plausible parameter values before a fit, and their uncertainties. The values are those of the robot file."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.log import Array
from psdmc.robot.mechanism import Mechanism

STATES = 200
SEED = 51_407
ORDINARY_SPEED = 1.0
"""rad/s, m/s: an ordinary speed of a robot."""
ORDINARY_ACCELERATION = 5.0
"""rad/s^2, m/s^2: an ordinary acceleration."""
QUIET_JOINT = 0.02
"""Least share of the largest joint torque that every joint gets as its size: one that carries nothing shows only noise."""
NO_EFFECT = 1e-9
"""Share of a column's largest entry below which the parameter has no effect on a joint."""


def torque_sizes(torque: Array) -> Array:
    """Return a typical torque (n,) of each joint: the RMS of its torques (N, n), N m.

    The result for a joint is at least the share QUIET_JOINT of the largest RMS of all joints.
    """
    size = np.sqrt(np.mean(torque**2, axis=0))
    return np.asarray(np.maximum(size, QUIET_JOINT * float(size.max(initial=0.0)) or 1.0))


def base_parameter_scale(chain: Mechanism, model: Regressor, sizes: Array, theta_b: Array | None) -> Array:
    """Return a plausible size (l,) of each base parameter, as a scale for priors.

    This is the value with which the parameter alone explains the typical torque of a joint in an ordinary motion.

    sizes    (n,) N m, typical torques of the joints
    theta_b  (l,) base parameters of the robot file, which are plausible sizes, too; None: the file gives none
    """
    rng = np.random.default_rng(SEED)
    n = len(chain)
    q = rng.uniform(-np.pi, np.pi, (STATES, n))
    qd = rng.uniform(-ORDINARY_SPEED, ORDINARY_SPEED, (STATES, n))
    qdd = rng.uniform(-ORDINARY_ACCELERATION, ORDINARY_ACCELERATION, (STATES, n))
    effect = np.sqrt(np.mean(model.regressor(q, qd, qdd) ** 2, axis=0))
    acts = effect > NO_EFFECT * effect.max(axis=0, initial=0.0)
    scale = np.min(np.where(acts, sizes[:, None] / np.where(acts, effect, 1.0), np.inf), axis=0)
    scale = np.where(np.isfinite(scale), scale, 1.0)
    return scale if theta_b is None else np.maximum(scale, np.abs(theta_b))
