"""Motors that drive several joints together: q_joint = C q_motor and, by virtual work, tau_joint = C^-T tau_motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import Matrix


@dataclass(frozen=True, slots=True, eq=False)
class Coupling:
    """The matrix C in q_joint = C q_motor for n motors that drive n joints together, and its inverse. Motor k has the
    name of joint k. In arrays of positions or torques, each row is one sample."""

    matrix: Array
    inverse: Array

    @staticmethod
    def of(matrix: Sequence[Sequence[float]]) -> Coupling:
        """Return the Coupling of a square, invertible matrix."""
        values = np.array(matrix, dtype=np.float64)
        return Coupling(values, np.asarray(np.linalg.inv(values), dtype=np.float64))

    def to_joints(self, motion: Array) -> Array:
        """Return the positions, speeds or accelerations (..., n) of the joints from those of the motors."""
        return np.asarray(motion @ self.matrix.T)

    def to_motors(self, motion: Array) -> Array:
        """Return the positions, speeds or accelerations (..., n) of the motors from those of the joints."""
        return np.asarray(motion @ self.inverse.T)

    def torque_of_joints(self, torque: Array) -> Array:
        """Return the joint torques (..., n) that belong to motor torques."""
        return np.asarray(torque @ self.inverse)

    def torque_of_motors(self, torque: Array) -> Array:
        """Return the motor torques (..., n) that belong to joint torques."""
        return np.asarray(torque @ self.matrix)


def coupling_of(matrix: Matrix) -> Coupling | None:
    """Return the Coupling of a matrix, or None if the matrix is empty."""
    return Coupling.of(matrix) if matrix else None
