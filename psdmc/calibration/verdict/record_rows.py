"""Rows of a calibration's record that both methods have: base parameters and torque constants."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.identify.motor import MotorResult
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.visibility import IDENTIFIED, Visibility
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.record import NumberRow, ParameterRow
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.mechanism import Joint

MOVED = 1e-6
"""Distance from the prior, in units of what is believable, from which an invisible parameter counts as moved by
physical consistency."""


def kept_at(model: DynamicsModel, values: Array, scale: Array) -> list[str]:
    """The value that each unseen parameter is kept at, in words: friction at zero, theta_b at the file's."""
    prior = np.zeros(len(values))
    prior[: model.l] = 0.0 if model.theta_b is None else model.theta_b
    names = ["zero" if model.theta_b is None else "the file's value"] * model.l
    names += ["zero"] * (len(values) - model.l)
    moved = np.abs(values - prior) > MOVED * scale
    return [
        f"the physical value nearest to {name}" if m else name for name, m in zip(names, moved, strict=True)
    ]


def unit_of(joint: Joint, turning: str) -> str:
    """The unit of a joint's number, given that of one that turns: for Nms/rad Ns/m where it slides."""
    return turning.replace("Nm", "N").replace("rad", "m") if joint.type.effort_unit == "N" else turning


def by_joint(model: DynamicsModel, values: Array) -> dict[str, float]:
    """Values (n,) by their joints' names."""
    return dict(zip(model.joint_names, values.tolist(), strict=True))


def parameter_rows(
    model: DynamicsModel, theta: Array, std: Array, groups: list[str], seen: Visibility
) -> tuple[ParameterRow, ...]:
    """One row for each base parameter: theta and std (l,), the group of each, and what the data show of it."""
    return tuple(
        ParameterRow(
            name=f"theta_{k + 1}",
            group=groups[k],
            value=float(theta[k]),
            std=float(std[k]) if seen.determined[k] else float("inf"),
            unit=parameter.unit,
            equation=parameter.equation,
            identifiable=seen.words[k] == IDENTIFIED,
            visibility=seen.words[k],
            file=None if model.theta_b is None else float(model.theta_b[k]),
        )
        for k, parameter in enumerate(model.base_parameters)
    )


def motor_rows(model: DynamicsModel, motors: Motors, step: MotorResult | None) -> tuple[NumberRow, ...]:
    """Rows of the torque constants; none where torques were logged. A given constant, which is exact, is marked as not
    seen."""
    constants, relative = motors.torque_constant, motors.relative_std
    if step is None and np.all(constants == 1.0):
        return ()
    seen = relative > 0.0 if step is None else step.identified
    own = zip(model.mechanism.joints, constants, relative, seen, strict=True)
    return tuple(
        NumberRow(
            joint.name,
            "torque_constant",
            float(value),
            float(abs(value) * share),
            unit_of(joint, "Nm/A"),
            bool(known),
        )
        for joint, value, share, known in own
    )
