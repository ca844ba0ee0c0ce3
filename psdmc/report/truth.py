"""Compares a calibration with the true parameters, which are known only for a virtual (simulated) robot, and with the
tables of Denso-2022. The report of a virtual robot shows all three."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from psdmc.calibration.identify.state_friction import PARAMETERS
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.plant.virtual_robot import VirtualRobot
from psdmc.errors import InputError
from psdmc.model.calibrated import Calibrated
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.summary import joined_units
from psdmc.report import published_denso as published
from psdmc.report.calibrate_tables import NOTHING, joint_number, number, r_squared, table


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


WHY = (
    "The paper's figures are of a real robot, whose gears, cable harness and sensors do what no model of rigid bodies with "
    "LuGre friction does; the virtual robot has the model's own effects{harness} and its sensors' noise, and values that "
    "were made like the paper's only where these can be read and some robot can have them."
)
"""Why the two columns differ."""


@dataclass(frozen=True, slots=True)
class TruthView:
    """The sections that only the report of a virtual robot has. Tables are HTML text.

    banner      states that the robot is virtual, and its sensors
    parameters  every base parameter with its true value
    joints, accuracy, published  tables 2, 3 and 4 of Denso-2022 with the values of this calibration
    why         text that explains the differences
    """

    banner: str
    parameters: str
    joints: str
    accuracy: str
    published: str
    why: str


def truth_view(record: Calibrated, true_model: DynamicsModel, robot: VirtualRobot) -> TruthView:
    """Return the sections on true parameters for the report of the virtual Denso robot. `true_model` has the true base
    parameters theta_b, in the order of the calibration record."""
    sensors, harness = robot.sensors, robot.harness
    noisy = sensors.current_noise or sensors.position_step
    with_sensors = (
        f"positions in steps of {sensors.position_step:g} rad, currents with {sensors.current_noise:g} A of noise, "
        f"{1e3 * sensors.effort_delay:g} ms late"
        if noisy
        else "ideal"
    )
    held = f" A cable harness pulls at {', '.join(harness.joints)}." if harness is not None else ""
    return TruthView(
        banner=f"This robot is virtual. Its logs are simulated ({robot.name}: Pinocchio's rigid bodies, LuGre friction by a "
        f"stiff integrator), so that its true parameters are known. Sensors: {with_sensors}.{held}",
        parameters=_parameters(record, true_model.known_theta_b()),
        joints=_joints(record, robot),
        accuracy=_accuracy(record),
        published=_published(record, true_model),
        why=WHY.format(harness=", a cable harness" if harness is not None else ""),
    )


def _parameters(record: Calibrated, truth: np.ndarray) -> str:
    head = ["Parameter", "Truth", "Found", "±", "Error / ±", "Unit", "Equation"]
    rows = [
        [
            row.name,
            f"{true:.6g}",
            f"{row.value:.6g}",
            *_error(row.value, row.std, float(true)),
            row.unit,
            row.equation,
        ]
        for row, true in zip(record.parameters, truth, strict=True)
    ]
    return table(head, rows, text_columns=(6,))


def _error(value: float, std: float, true: float) -> list[str]:
    """Standard deviation, and the error in units of it."""
    if not (math.isfinite(std) and std > 0.0):
        return [NOTHING, NOTHING]
    return [f"{std:.2g}", f"{(value - true) / std:+.1f}"]


def _joints(record: Calibrated, robot: VirtualRobot) -> str:
    """Table 2: three lines a joint."""
    rows = [*record.motors, *record.friction]
    found = {(row.joint, row.name): row for row in rows}
    units = joined_units((row.name, row.unit) for row in rows)
    names = [name for name in published.PARAMETERS if name in units]
    head = ["Joint", "", *(f"{name.replace('_', ' ')} [{units[name]}]" for name in names)]
    lines = []
    for k, joint in enumerate(robot.joints):
        lines.append([joint.name, "found", *(joint_number(found.get((joint.name, name))) for name in names)])
        true = {"torque_constant": joint.torque_constant, **joint.friction}
        lines.append(["", "truth", *(f"{true[name]:.4g}" for name in names)])
        lines.append(["", "paper", *(f"{published.PARAMETERS[name][k]:.4g}" for name in names)])
    return table(head, lines)


def _accuracy(record: Calibrated) -> str:
    """Table 3: RMSE and R^2 of held-out data, two lines a joint."""
    steps = [step for step in record.steps if step.step in published.ACCURACY]
    head = ["Joint", "", *(f"{step.step}: {what} held out" for step in steps for what in ("RMSE", "R²"))]
    lines = []
    for k, joint in enumerate(record.joint_names):
        own, theirs = [joint, "this page"], ["", "paper"]
        for step in steps:
            both = step.joints.get(joint)
            own += (
                [NOTHING] * 2 if both is None else [number(both.held_out.rmse), r_squared(both.held_out.r2)]
            )
            rmse, r2 = published.ACCURACY[step.step][k]
            theirs += [number(rmse), f"{r2:.2f}" if math.isfinite(r2) else NOTHING]
        lines += [own, theirs]
    return table(head, lines)


def _published(record: Calibrated, true_model: DynamicsModel) -> str:
    """Table 4: the paper's parameters as combinations of theta_b."""
    values = np.array([row.value for row in record.parameters])
    truth = true_model.known_theta_b()
    head = [
        "Paper's name",
        "Paper",
        "Truth here",
        "Found",
        "±",
        "Unit",
        "Equation",
        "Truth made like the paper's",
    ]
    rows = []
    for line in published.BASE_PARAMETERS:
        by_ours = line.by_base_parameters(true_model)
        rows.append(
            [
                line.name,
                f"{line.value:.3g}",
                f"{by_ours @ truth:.4g}",
                f"{by_ours @ values:.4g}",
                _std_of(record, by_ours),
                line.unit,
                line.equation,
                "yes" if line.fitted else "no",
            ]
        )
    return table(head, rows, text_columns=(6,))


def _std_of(record: Calibrated, by_ours: Sequence[float] | np.ndarray) -> str:
    """Standard deviation of a combination of base parameters; none where one of them has none."""
    used = np.flatnonzero(np.asarray(by_ours))
    stds = np.array([record.parameters[k].std for k in used])
    if record.covariance is None or not np.isfinite(stds).all():
        return NOTHING
    part = np.asarray(by_ours)[used]
    return f"{math.sqrt(max(float(part @ record.covariance[np.ix_(used, used)] @ part), 0.0)):.2g}"
