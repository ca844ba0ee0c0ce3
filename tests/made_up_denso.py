"""A calibration of the virtual Denso, made up: the truth, each number off by a known share of its standard deviation."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from psdmc.calibration.plant.virtual_robot import VirtualRobot, load_virtual_robot
from psdmc.calibration.verdict.record import Calibration
from psdmc.compiler import derive
from psdmc.model.calibrated import JointQuality, NumberRow, ParameterRow, Quality, StepQuality
from psdmc.model.dynamics_model import DynamicsModel

EXAMPLES = Path(__file__).parent.parent / "examples"
OFF, STD = 0.5, 0.01
"""Every number is off by half a standard deviation, which is a hundredth of it."""
STEPS = ("Motor", "Gravity", "Friction", "Inertial", "All")
UNITS = {
    "torque_constant": "Nm/A",
    "coulomb": "Nm",
    "static": "Nm",
    "stribeck_velocity": "rad/s",
    "viscous": "Nms/rad",
}
UNITS |= {"viscous_exponent": "-", "stiffness": "Nm/rad", "damping": "Nms/rad"}


@cache
def denso() -> DynamicsModel:
    return derive(EXAMPLES / "robots" / "denso_wall.toml", drive_inertia=True)


@cache
def plant(harness: bool = False) -> VirtualRobot:
    return load_virtual_robot(EXAMPLES / "plants" / "denso_virtual.toml", harness=harness)


def made_up_record() -> Calibration:
    """With table 3's columns all alike: RMSE 0.2 and R^2 0.9876 held out."""
    model = denso()
    truth = model.known_theta_b()
    std = STD * np.abs(truth)
    quality = JointQuality(Quality(0.1, 0.999), Quality(0.2, 0.9876))
    numbers = [
        NumberRow(joint.name, name, value * (1.0 + OFF * STD), STD * value, unit)
        for joint in plant().joints
        for name, unit in UNITS.items()
        for value in [joint.friction.get(name, joint.torque_constant)]
    ]
    return Calibration(
        robot="denso_wall",
        method="four steps",
        joint_names=model.joint_names,
        model=replace(model, theta_b=None),
        parameters=tuple(
            ParameterRow(f"theta_{k + 1}", "inertial", float(v + OFF * s), float(s), p.unit, p.equation, True)
            for k, (v, s, p) in enumerate(zip(truth, std, model.base_parameters, strict=True))
        ),
        motors=tuple(row for row in numbers if row.name == "torque_constant"),
        friction=tuple(row for row in numbers if row.name != "torque_constant"),
        steps=tuple(StepQuality(step, dict.fromkeys(model.joint_names, quality)) for step in STEPS),
        warnings=(),
        covariance=np.diag(std**2),
    )
