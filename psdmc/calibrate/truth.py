"""A calibration against the truth that only a virtual robot has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from psdmc.calibrate.lugre import PARAMETERS
from psdmc.calibrate.record import Calibration
from psdmc.calibrate.virtual_robot import VirtualRobot
from psdmc.model.dynamics_model import DynamicsModel


@dataclass(frozen=True, slots=True)
class Comparison:
    """Largest errors.

    torque_constant      relative, of any joint
    gravity, inertial    of any base parameter, relative to the largest of its group
    friction             relative, by parameter name, of any joint
    within_three_std     share of base parameters whose truth lies within three standard deviations
    """

    torque_constant: float
    gravity: float
    inertial: float
    friction: dict[str, float]
    within_three_std: float

    def lines(self) -> list[str]:
        """For people."""
        worst = ", ".join(f"{name} {error:.2%}" for name, error in self.friction.items())
        return [
            f"  largest error: K_t {self.torque_constant:.4%}, gravity {self.gravity:.4%}, inertial {self.inertial:.4%}",
            f"  largest error of friction: {worst}",
            f"  truth within 3 standard deviations: {self.within_three_std:.0%} of base parameters",
        ]

    def as_json(self) -> dict[str, Any]:
        return {
            "torque_constant": self.torque_constant,
            "gravity": self.gravity,
            "inertial": self.inertial,
            "friction": self.friction,
            "within_three_std": self.within_three_std,
        }


def compare(record: Calibration, true_model: DynamicsModel, robot: VirtualRobot) -> Comparison:
    """Errors of a campaign's record; the model of the truth has the same base parameters as the record's."""
    assert true_model.theta_b is not None
    truth = true_model.theta_b
    error = np.array([row.value for row in record.parameters]) - truth
    std = np.array([row.std for row in record.parameters])
    groups = np.array([row.group for row in record.parameters])
    joints = {joint.name: joint for joint in robot.joints}
    constants = [abs(row.value / joints[row.joint].torque_constant - 1.0) for row in record.motors]
    friction = {
        name: max(
            abs(row.value / getattr(joints[row.joint], name) - 1.0)
            for row in record.friction
            if row.name == name
        )
        for name in PARAMETERS
    }
    return Comparison(
        torque_constant=float(max(constants)),
        gravity=_largest(error, truth, groups == "gravity"),
        inertial=_largest(error, truth, groups == "inertial"),
        friction={name: float(value) for name, value in friction.items()},
        within_three_std=float(np.mean(np.abs(error) < 3.0 * std)),
    )


def _largest(error: np.ndarray, truth: np.ndarray, group: np.ndarray) -> float:
    return float(np.abs(error[group]).max() / np.abs(truth[group]).max())
