"""Converts logged effort to motor torque, and gives the effect of uncertain torque constants on a fit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.linear_rows import Block, Rows
from psdmc.calibration.logs.log import Array


@dataclass(frozen=True, slots=True, eq=False)
class Motors:
    """The factors from logged effort to motor torque: torque constants if currents are logged, all one if torques are
    logged.

    torque_constant  (n,) N m/A, one per joint; 1 if torques are logged
    relative_std     (n,) relative standard deviation of each constant
    """

    torque_constant: Array
    relative_std: Array

    @staticmethod
    def torques(n: int) -> Motors:
        """Return conversion factors of one for n motors, for logs whose effort is motor torque instead of current."""
        return Motors(np.ones(n), np.zeros(n))

    def torque(self, effort: Array) -> Array:
        """Return the motor torque (..., n), N m: the logged effort (..., n) times the torque constant of each of n
        joints."""
        return np.asarray(effort * self.torque_constant)

    @property
    def relative_covariance(self) -> Array | None:
        """Covariance (n, n) of the relative errors of the torque constants; None if all are exact."""
        return np.diag(self.relative_std**2) if self.relative_std.any() else None


@dataclass(frozen=True, slots=True, eq=False)
class RowsByMotors:
    """The rows of a linear fit of joint torques, each with its derivatives by the relative errors of the torque
    constants.

    A motor's torque is proportional to its torque constant, so the derivative by the relative error is the torque.

    rows    blocks of regressor rows
    torque  (N, n) N m, measured torques of N samples and n joints
    """

    rows: Rows
    torque: Array

    def __iter__(self) -> Iterator[Block]:
        first, n = 0, self.torque.shape[1]
        for block in self.rows:
            own = slice(first, first + len(block))
            first = own.stop
            yield Block(block.columns, block.noise, self.torque[own, :, None] * np.eye(n))
