"""Torque limits: what a motion takes of the motors, by the model's own theta_b and friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.predictor import Regressor, payload_torque
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.fit_columns import SPEED_STEP
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True, eq=False)
class TorqueLimits:
    """Largest torques and how a motion's are computed.

    largest   (n,) N m (N), infinite where a joint has no limit
    theta_b   (l,)
    friction  (..., n) speeds to (..., n) torques; None: not known
    """

    chain: Mechanism
    model: Regressor
    largest: Array
    theta_b: Array
    friction: Callable[[Array], Array] | None = None

    def torque(self, q: Array, qd: Array, qdd: Array, load: Load | None = None) -> Array:
        """(N, n) N m (N). A load counts by its weight alone: it is carried in slow sweeps."""
        tau = self.of(self.model.regressor(q, qd, qdd), qd)
        return tau if load is None else tau + payload_torque(self.chain, q, load.mass, load.com)

    def of(self, regressor: Array, qd: Array) -> Array:
        """(..., n) from the regressor (..., n, l) and the speeds."""
        tau = np.asarray(regressor @ self.theta_b)
        return tau if self.friction is None else tau + self.friction(qd)

    def excess(self, regressor: Array, qd: Array, share: float) -> tuple[float, Array, Array]:
        """What torques take beyond `share` of their limits: the mean over samples of its squares, in shares of the limit,
        and its derivatives by the regressor (N, n, l) and, through friction, by the speeds (N, n)."""
        tau = self.of(regressor, qd)
        usable = share * self.largest
        beyond = np.maximum(np.abs(tau) / usable - 1.0, 0.0)
        by_torque = 2.0 * beyond * np.sign(tau) / usable / len(tau)
        by_speed = np.zeros_like(qd)
        if self.friction is not None:
            rate = (self.friction(qd + SPEED_STEP) - self.friction(qd - SPEED_STEP)) / (2 * SPEED_STEP)
            by_speed = by_torque * rate
        return float(np.sum(beyond**2)) / len(tau), by_torque[..., None] * self.theta_b, by_speed

    def faults(self, tau: Array, share: float) -> list[str]:
        """One sentence for each joint whose torque (N, n) goes beyond `share` of its limit."""
        reach = np.abs(tau).max(axis=0)
        return [
            f"{joint.name}: torque {value:.4g} beyond {share:.0%} of {limit:g}"
            for joint, value, limit in zip(self.chain.joints, reach, self.largest, strict=True)
            if value > share * limit
        ]
