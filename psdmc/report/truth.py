"""Compares a calibration with the true parameters, which are known only for a virtual (simulated) robot, and with the
tables of Denso-2022. The report of a virtual robot shows all three."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from psdmc.calibration.identify.state_friction import PARAMETERS
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import Array
from psdmc.calibration.plant.virtual_robot import VirtualRobot
from psdmc.errors import InputError, InternalError
from psdmc.model.calibrated import Calibrated
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.summary import joined_units
from psdmc.report.calibrate_tables import NOTHING, joint_number, number, r_squared, table
from psdmc.robot.mechanism import PARAMETERS_PER_LINK


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
    names = [name for name in TABLE_2 if name in units]
    head = ["Joint", "", *(f"{name.replace('_', ' ')} [{units[name]}]" for name in names)]
    lines = []
    for k, joint in enumerate(robot.joints):
        lines.append([joint.name, "found", *(joint_number(found.get((joint.name, name))) for name in names)])
        true = {"torque_constant": joint.torque_constant, **joint.friction}
        lines.append(["", "truth", *(f"{true[name]:.4g}" for name in names)])
        lines.append(["", "paper", *(f"{TABLE_2[name][k]:.4g}" for name in names)])
    return table(head, lines)


def _accuracy(record: Calibrated) -> str:
    """Table 3: RMSE and R^2 of held-out data, two lines a joint."""
    steps = [step for step in record.steps if step.step in TABLE_3]
    head = ["Joint", "", *(f"{step.step}: {what} held out" for step in steps for what in ("RMSE", "R²"))]
    lines = []
    for k, joint in enumerate(record.joint_names):
        own, theirs = [joint, "this page"], ["", "paper"]
        for step in steps:
            both = step.joints.get(joint)
            own += (
                [NOTHING] * 2 if both is None else [number(both.held_out.rmse), r_squared(both.held_out.r2)]
            )
            rmse, r2 = TABLE_3[step.step][k]
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
    for line in TABLE_4:
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


# Tables 2 to 4 as printed in Denso-2022
#
# Denso-2022: Application of Pseudo-Symbolic Dynamic Modeling (PSDM) in the Modeling & Calibration of a 6-DOF
# Articulated Robot. Of table 4, there are only the rows whose printed equations can be read and are true for the robot.
# The other rows lost signs or indices in print.

TABLE_2: Mapping[str, tuple[float, ...]] = {
    "torque_constant": (36.1, 40.3, 24.4, 17.9, 14.6, 5.42),
    "coulomb": (9.59, 8.86, 6.20, 3.59, 2.39, 1.60),
    "static": (12.5, 9.92, 7.77, 4.00, 2.67, 1.53),
    "stribeck_velocity": (14.4e-3, 20.1e-3, 32.0e-3, 210e-3, 81.1e-3, 10.4e-3),
    "viscous": (23.7, 28.7, 10.7, 2.38, 4.50, 1.61),
    "viscous_exponent": (0.61, 0.62, 0.73, 0.63, 0.59, 0.74),
    "stiffness": (288e3, 250e3, 130e3, 5.36e3, 35.9e3, 13.0e3),
    "damping": (22.8, 21.2, 19.2, 8.91, 13.9, 10.3),
}
"""Table 2, joints 1 to 6, SI; of damping, whose header says kN m s/rad, the numbers are N m s/rad."""

NAN = float("nan")
TABLE_3: Mapping[str, tuple[tuple[float, float], ...]] = {
    "Motor": ((0.24, 1.00), (0.46, 1.00), (0.35, 1.00), (0.06, 1.00), (0.12, 1.00), (0.04, 1.00)),
    "Gravity": ((0.30, 1.00), (0.41, 1.00), (0.55, 1.00), (0.13, 0.98), (0.18, 0.95), (0.16, NAN)),
    "Friction": ((2.16, 0.99), (3.06, 0.98), (0.61, 1.00), (0.52, 0.99), (0.49, 0.99), (0.27, 0.99)),
    "Inertial": ((2.16, 0.78), (2.79, 0.84), (3.02, 0.35), (0.95, 0.05), (0.55, 0.40), (0.90, 0.06)),
    "All": ((NAN, 0.99), (NAN, 0.97), (NAN, 0.86), (NAN, 0.91), (NAN, 0.96), (NAN, 0.81)),
}
"""Table 3: RMSE (N m) and R^2 on validation data, joints 1 to 6; nan: not printed."""

A1, A2, A3, D4 = 0.075, -0.27, -0.09, 0.295
"""m, the robot's lengths."""
LINK_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz", "Im")
"""Of a link's standard parameters, in their order."""


@dataclass(frozen=True, slots=True)
class PublishedParameter:
    """A row of table 4 of Denso-2022: a base parameter.

    value     in SI units
    equation  in standard parameters about the links' frames (mx = m rx; Ixx and so on about the origin)
    terms     the equation as coefficients by parameter and link
    fitted    whether the masses and inertias of the virtual robot were chosen to give this value, as nearly as real
              bodies can
    """

    name: str
    value: float
    unit: str
    equation: str
    terms: Mapping[str, float]
    fitted: bool = True

    def by_base_parameters(self, model: DynamicsModel) -> Array:
        """(l,) its coefficients in the model's theta_b."""
        wanted = np.zeros(PARAMETERS_PER_LINK * len(model.mechanism))
        for term, coefficient in self.terms.items():
            wanted[PARAMETERS_PER_LINK * (int(term[-1]) - 1) + LINK_NAMES.index(term[:-1])] = coefficient
        span = model.mechanism.parameter_span
        found = np.linalg.lstsq((model.B @ span).T, span.T @ wanted, rcond=None)[0]
        if np.abs(found @ model.B @ span - wanted @ span).max() > ROUNDING * np.abs(wanted).max():
            raise InternalError(
                f"{self.name} of Denso-2022 is no combination of {model.mechanism.name}'s theta_b"
            )
        return np.where(np.abs(found) < ROUNDING * np.abs(found).max(), 0.0, found)


ROUNDING = 1e-9
"""Of coefficients."""

_line = PublishedParameter
TABLE_4 = (
    _line("θ1", 7.42, "kg", "m1 + mx1/a1 - mx2/a2", {"m1": 1, "mx1": 1 / A1, "mx2": -1 / A2}),
    _line("θ2", 0.566, "kg m", "mz1 + mz2 + my3", {"mz1": 1, "mz2": 1, "my3": 1}),
    _line("θ4", 5.46, "kg", "m2 + mx2/a2 - mx3/a3", {"m2": 1, "mx2": 1 / A2, "mx3": -1 / A3}),
    _line("θ5", -0.0632, "kg m", "my2", {"my2": 1}),
    _line(
        "θ11",
        4.10,
        "kg",
        "m3 - (mz3 - my4)/d4 + mx3/a3",
        {"m3": 1, "mz3": -1 / D4, "my4": 1 / D4, "mx3": 1 / A3},
    ),
    _line("θ12", 3.38, "kg", "(mz3 - my4)/d4 + m4 + m5", {"mz3": 1 / D4, "my4": -1 / D4, "m4": 1, "m5": 1}),
    _line("θ19", -0.0165, "kg m", "mz4 + my5", {"mz4": 1, "my5": 1}),
    _line("θ20", -0.0179, "kg m", "mx4", {"mx4": 1}),
    _line("θ27", 0.0793, "kg m", "mz5", {"mz5": 1}),
    _line("θ18", 0.561, "kg m^2", "Im3", {"Im3": 1}),
    _line("θ26", 0.0838, "kg m^2", "Im4", {"Im4": 1}),
    _line("θ28", -0.00706, "kg m^2", "Ixx5 - Iyy5 - Izz5", {"Ixx5": 1, "Iyy5": -1, "Izz5": -1}),
    _line("θ29", 0.00694, "kg m^2", "Iyy5", {"Iyy5": 1}),
    _line("θ31", 0.092, "kg m^2", "Im5", {"Im5": 1}),
    _line("θ32", 0.0306, "kg m^2", "Im6", {"Im6": 1}),
    _line("θ15", 0.0397, "kg m^2", "Ixz3", {"Ixz3": 1}, False),
    _line("θ16", -0.0199, "kg m^2", "Ixy3 - a3 my3", {"Ixy3": 1, "my3": -A3}, False),
    _line("θ17", -0.0123, "kg m^2", "Iyz3", {"Iyz3": 1}, False),
    _line(
        "θ21",
        -0.0573,
        "kg m^2",
        "Ixx4 + Iyy4 - Izz4 + 2 Izz5",
        {"Ixx4": 1, "Iyy4": 1, "Izz4": -1, "Izz5": 2},
        False,
    ),
    _line("θ23", -0.0172, "kg m^2", "Ixy4", {"Ixy4": 1}, False),
    _line("θ24", 0.00447, "kg m^2", "-Iyz4", {"Iyz4": -1}, False),
    _line("θ25", -0.0704, "kg m^2", "-Ixz4", {"Ixz4": -1}, False),
    _line("θ30", -0.00622, "kg m^2", "-Iyz5", {"Iyz5": -1}, False),
)
"""Table 4."""
