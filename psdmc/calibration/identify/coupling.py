"""Motors that drive several joints: q_joint = C q_motor and, by virtual work, tau_joint = C^-T tau_motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import Matrix


@dataclass(frozen=True, slots=True, eq=False)
class Coupling:
    """The coupling matrix C of n motors and n joints; motor k is named like joint k. Rows of arrays are samples."""

    matrix: Array
    inverse: Array

    @staticmethod
    def of(matrix: Sequence[Sequence[float]]) -> Coupling:
        """Of a square matrix that has an inverse."""
        values = np.array(matrix, dtype=np.float64)
        return Coupling(values, np.asarray(np.linalg.inv(values), dtype=np.float64))

    def to_joints(self, motion: Array) -> Array:
        """(..., n) of motors to joints: positions, speeds or accelerations."""
        return np.asarray(motion @ self.matrix.T)

    def to_motors(self, motion: Array) -> Array:
        """(..., n) of joints to motors."""
        return np.asarray(motion @ self.inverse.T)

    def torque_of_joints(self, torque: Array) -> Array:
        """(..., n) motor torques to joint torques."""
        return np.asarray(torque @ self.inverse)

    def torque_of_motors(self, torque: Array) -> Array:
        """(..., n) joint torques to motor torques."""
        return np.asarray(torque @ self.matrix)


def coupling_of(matrix: Matrix) -> Coupling | None:
    """The coupling of a matrix; None where it is empty."""
    return Coupling.of(matrix) if matrix else None
