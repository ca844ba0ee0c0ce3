"""Compares a calibration with the true parameters, which are known only for a virtual (simulated) robot."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from psdmc.calibration.identify.state_friction import PARAMETERS
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.plant.virtual_robot import VirtualRobot
from psdmc.errors import InputError
from psdmc.model.calibrated import Calibrated
from psdmc.model.dynamics_model import DynamicsModel


@dataclass(frozen=True, slots=True)
class Comparison:
    """The largest errors of a calibration.

    torque_constant      relative error, largest of all joints
    gravity, inertial    largest error of a base parameter, relative to the largest parameter of its group
    friction             relative error by parameter name, largest of all joints
    within_three_std     share of base parameters whose true value lies within three standard deviations
    """

    torque_constant: float
    gravity: float
    inertial: float
    friction: dict[str, float]
    within_three_std: float

    def lines(self) -> list[str]:
        """Return the comparison as lines of text."""
        worst = ", ".join(f"{name} {error:.2%}" for name, error in self.friction.items())
        return [
            f"  largest error: K_t {self.torque_constant:.4%}, gravity {self.gravity:.4%}, inertial {self.inertial:.4%}",
            f"  largest error of friction: {worst}",
            f"  truth within 3 standard deviations: {self.within_three_std:.0%} of base parameters",
        ]

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def compare(record: Calibrated, true_model: DynamicsModel, robot: VirtualRobot) -> Comparison:
    """Return the errors of a campaign's result. The true model must have the same base parameters."""
    assert true_model.theta_b is not None
    truth = true_model.theta_b
    std = np.array([row.std for row in record.parameters])
    groups = np.array([row.group for row in record.parameters])
    joints = {joint.name: joint for joint in robot.joints}
    unknown = [row.joint for row in (*record.motors, *record.friction) if row.joint not in joints]
    if unknown:
        raise InputError(
            f"{robot.name}: not the robot that was calibrated: it has no joint {listed(unknown)}",
            "compare with the plant that the logs are of",
        )
    error = np.array([row.value for row in record.parameters]) - truth
    constants = [_relative(row.value, joints[row.joint].torque_constant) for row in record.motors]
    friction = {
        name: max(
            (
                _relative(row.value, joints[row.joint].friction[name])
                for row in record.friction
                if row.name == name
            ),
            default=0.0,
        )
        for name in PARAMETERS
    }
    return Comparison(
        torque_constant=max(constants, default=0.0),
        gravity=_largest(error, truth, groups == "gravity"),
        inertial=_largest(error, truth, groups == "inertial"),
        friction={name: float(value) for name, value in friction.items()},
        within_three_std=float(np.mean(np.abs(error) < 3.0 * std)),
    )


def _relative(found: float, truth: float) -> float:
    """Relative error; infinite where the truth is zero and something was found."""
    if truth == 0.0:
        return 0.0 if found == 0.0 else float("inf")
    return abs(found / truth - 1.0)


def _largest(error: np.ndarray, truth: np.ndarray, group: np.ndarray) -> float:
    return float(np.abs(error[group]).max() / np.abs(truth[group]).max())
