"""Motors: converts logged effort to motor torque, checks torque constants, and gives their effect on a fit.

Motors may drive several joints together: q_joint = C q_motor and, by virtual work, tau_joint = C^-T tau_motor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.least_squares import Block, Rows, with_rows
from psdmc.calibration.logs.foreign_bytes import first_faults, listed, quoted
from psdmc.calibration.logs.log import AnyLog, Array, Quantity
from psdmc.errors import InputError
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
        """Return the motor torque (..., n), N m: the logged effort (..., n) times each joint's torque constant."""
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
        n = self.torque.shape[1]
        for block, own in with_rows(self.rows):
            yield Block(block.columns, block.noise, self.torque[own, :, None] * np.eye(n))


LARGEST_CONSTANT = 1e6
"""N m/A at the joint, gear included: a thousand times the largest robot's."""


def require_constants(constants: Mapping[str, float], joint_names: Sequence[str]) -> None:
    """Raise InputError if a given torque constant belongs to no joint, or is not a positive number."""
    unknown = [quoted(name) for name in constants if name not in joint_names]
    if unknown:
        raise InputError(
            f"torque constants: no joint(s) {listed(unknown)}", f"the model has {listed(joint_names)}"
        )
    odd = [
        f"joint {name}: {value:g}" for name, value in constants.items() if not 0 < value <= LARGEST_CONSTANT
    ]
    if odd:
        raise InputError(
            f"torque constants: {first_faults(odd)}: expected positive numbers, at most {LARGEST_CONSTANT:g} N m/A",
            "if a positive current gives a negative torque, change the sign of the current in the log",
        )


def one_quantity(logs: Sequence[AnyLog]) -> Quantity:
    """Return the quantity that all logs record as effort: current or torque. Raises InputError with the names of the
    logs if they record different quantities."""
    by_quantity: dict[Quantity, list[str]] = {}
    for log in logs:
        by_quantity.setdefault(log.quantity, []).append(log.name)
    if len(by_quantity) > 1:
        held = "; ".join(f"{quantity} in {listed(names, 3)}" for quantity, names in by_quantity.items())
        raise InputError(
            f"the logs hold different things: {held}",
            "calibrate with logs of one kind, or turn the currents into motor_torque_nm columns",
        )
    return next(iter(by_quantity))


def motors_of_logs(
    joint_names: Sequence[str], logs: Sequence[AnyLog], constants: Mapping[str, float] | None
) -> Motors:
    """Return the motors that convert the effort in plain logs to torques.

    constants   N m/A by joint name, for logs of currents; None for logs of torques

    Raises InputError if constants are given for torques or missing for currents, or if the logs have different
    quantities.
    """
    require_constants(constants or {}, joint_names)
    quantity = one_quantity(logs)
    if quantity != "current":
        refuse_constants(constants, logs[0])
        return Motors.torques(len(joint_names))
    if not constants:
        raise InputError(
            f"{logs[0].name}: holds currents, and no torque constants are known",
            "give --torque-constants, a second log with a known load (--loaded, --load), or run a campaign",
        )
    missing = [name for name in joint_names if name not in constants]
    if missing:
        raise InputError(
            f"no torque constant for joint(s) {listed(missing)}", "give --torque-constants for them"
        )
    return Motors(np.array([constants[name] for name in joint_names]), np.zeros(len(joint_names)))


def refuse_constants(constants: Mapping[str, float] | None, log: AnyLog) -> None:
    """Raise InputError if torque constants are given although a log holds torques."""
    if constants:
        raise InputError(
            f"{log.name}: holds {log.quantity}, which torque constants are not for",
            "leave --torque-constants out; where the columns are currents, call them current_a.<joint>",
        )
