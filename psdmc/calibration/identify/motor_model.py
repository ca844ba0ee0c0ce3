"""Motor torque from logged effort, and its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array


@dataclass(frozen=True, slots=True, eq=False)
class Motors:
    """Torque per logged unit: K_t for currents, one for torques.

    torque_constant  (n,)  N m/A; one where torque is logged
    relative_std     (n,)  relative standard deviation
    """

    torque_constant: Array
    relative_std: Array

    @staticmethod
    def torques(n: int) -> Motors:
        """The motors of logs that hold torques: constants of one."""
        return Motors(np.ones(n), np.zeros(n))

    def torque(self, effort: Array) -> Array:
        """(..., n) motor torque of logged effort."""
        return np.asarray(effort * self.torque_constant)
