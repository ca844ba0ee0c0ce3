"""Converts logged effort to motor torque, and gives the effect of uncertain torque constants on a fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.linear_rows import Block, Rows
from psdmc.calibration.logs.log import Array


@dataclass(frozen=True, slots=True, eq=False)
class Motors:
    """The torque per logged unit of each motor: the torque constant for currents, one for torques.

    torque_constant  (n,)  N m/A; one if torque is logged
    relative_std     (n,)  relative standard deviation
    """

    torque_constant: Array
    relative_std: Array

    @staticmethod
    def torques(n: int) -> Motors:
        """Return the motors for logs of torques: all constants are one."""
        return Motors(np.ones(n), np.zeros(n))

    def torque(self, effort: Array) -> Array:
        """Return the motor torque (..., n) for logged effort."""
        return np.asarray(effort * self.torque_constant)

    @property
    def relative_covariance(self) -> Array | None:
        """Covariance (n, n) of the relative errors of the torque constants; None if all are exact."""
        return np.diag(self.relative_std**2) if self.relative_std.any() else None


@dataclass(frozen=True, slots=True, eq=False)
class RowsByMotors:
    """The rows of a problem, with the change of the torque per relative error of each torque constant.

    torque  (N, n) N m, of the problem
    """

    rows: Rows
    torque: Array

    def __iter__(self) -> Iterator[Block]:
        first, n = 0, self.torque.shape[1]
        for block in self.rows:
            own = slice(first, first + len(block))
            first = own.stop
            yield Block(block.columns, block.noise, self.torque[own, :, None] * np.eye(n))
