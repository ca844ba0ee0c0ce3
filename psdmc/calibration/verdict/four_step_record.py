"""The record of a campaign that was calibrated in four steps."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.identify.four_steps import FourSteps
from psdmc.calibration.identify.prediction import FrictionRunConstants, Prediction
from psdmc.calibration.identify.steps import CalibrationOptions
from psdmc.calibration.identify.visibility import visibility, visibility_warnings, weak_notes
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.record import Calibration, NumberRow, with_model
from psdmc.calibration.verdict.record_rows import (
    by_joint,
    dropped_links,
    kept_at,
    motor_rows,
    parameter_rows,
    unit_of,
)
from psdmc.friction.law import Term
from psdmc.friction.state import STATE_LAW
from psdmc.model.dynamics_model import DynamicsModel


def four_step_record(
    model: DynamicsModel, found: FourSteps, theta_b: Array, options: CalibrationOptions
) -> Calibration:
    """The record of a campaign with these base parameters, without its quality."""
    inertial, gravity = found.inertial, found.gravity
    groups = ["inertial"] * model.l
    for k in gravity.split.pivots:
        groups[int(k)] = "gravity"
    names = model.base_parameters.labels
    at = kept_at(model, theta_b, inertial.scale)
    seen = visibility(names, theta_b, inertial.std, inertial.unseen / inertial.scale[:, None], at)
    facts = {
        "delay_s": found.friction.delay,
        "gravity_rank": gravity.estimate.rank,
        "gravity_condition": gravity.estimate.condition,
        "gravity_singular_values": gravity.estimate.singular_values.tolist(),
        "inertial_rank": inertial.estimate.rank,
        "inertial_condition": inertial.estimate.condition,
        "inertial_singular_values": inertial.estimate.singular_values.tolist(),
        "residual_correlation": by_joint(model, inertial.estimate.correlation),
        "noise_factor": max(gravity.estimate.noise_factor, inertial.estimate.noise_factor),
    }
    steps = {
        "motor": options.motor,
        "gravity": options.gravity,
        "friction": options.friction,
        "inertial": options.inertial,
    }
    runs = {
        name: FrictionRunConstants(joint.inertia, joint.offset, joint.delay)
        for name, joint in found.friction.joints.items()
    }
    return with_model(
        Calibration(
            robot=model.mechanism.name,
            method="four steps",
            joint_names=model.joint_names,
            model=model,
            parameters=parameter_rows(model, theta_b, inertial.std, groups, seen),
            motors=motor_rows(model, found.motors, found.motor),
            friction=_friction_rows(model, found),
            steps=(),
            warnings=(*dropped_links(model), *found.warnings, *visibility_warnings("inertial", names, seen)),
            facts=facts,
            prediction=Prediction(STATE_LAW.name, steps, runs=runs),
            notes=weak_notes("inertial", names, seen),
            covariance=inertial.covariance + inertial.prior_covariance,
        ),
        theta_b,
    )


def _friction_rows(model: DynamicsModel, found: FourSteps) -> tuple[NumberRow, ...]:
    """The seven per joint; the uncertainty of forces includes the torque constant's."""
    relative = dict(zip(model.joint_names, found.motors.relative_std.tolist(), strict=True))
    rows: list[NumberRow] = []
    joints = {joint.name: joint for joint in model.mechanism.joints}
    units = Term(STATE_LAW).units()
    for name, joint in found.friction.joints.items():
        values = zip(STATE_LAW.parameters, joint.friction.tolist(), joint.std.tolist(), units, strict=True)
        for parameter, value, std, unit in values:
            by_constant = relative[name] * value if unit.startswith("Nm") else 0.0
            seen = parameter not in joint.unseen
            own = unit_of(joints[name], unit)
            rows.append(NumberRow(name, parameter, value, float(np.hypot(std, by_constant)), own, seen))
    return tuple(rows)
