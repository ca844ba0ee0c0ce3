"""The paper's four steps one after the other: motors, gravity, friction, inertia."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibrate.friction import FrictionResult, calibrate_friction
from psdmc.calibrate.gravity import GravityResult, calibrate_gravity, gravity_split
from psdmc.calibrate.inertial import InertialResult, calibrate_inertial
from psdmc.calibrate.log import Array
from psdmc.calibrate.motor import MotorResult, calibrate_motors
from psdmc.calibrate.motor_model import Motors
from psdmc.calibrate.predictor import Regressor
from psdmc.calibrate.steps import CalibrationOptions, FrictionRun, GravityRun, InertialRun, MotorRun
from psdmc.errors import InputError
from psdmc.robot.chain import Chain

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """All logs of a calibration, step by step."""

    motor: Sequence[MotorRun]
    gravity: Sequence[GravityRun]
    friction: Sequence[FrictionRun]
    inertial: Sequence[InertialRun]


@dataclass(frozen=True, slots=True, eq=False)
class FourSteps:
    """What the four steps found; `motor` is None where the logs hold torques."""

    motor: MotorResult | None
    motors: Motors
    gravity: GravityResult
    friction: FrictionResult
    inertial: InertialResult

    @property
    def warnings(self) -> tuple[str, ...]:
        found = self.motor.warnings if self.motor is not None else ()
        return (*found, *self.gravity.warnings, *self.friction.warnings, *self.inertial.warnings)


def calibrate_four_steps(
    chain: Chain,
    model: Regressor,
    l: int,
    runs: Runs,
    options: CalibrationOptions | None = None,
    progress: Progress | None = None,
) -> FourSteps:
    """Torque constants, gravity, friction, inertia; gravity to inertia as often as the options say."""
    options = options or CalibrationOptions()
    say = progress or (lambda step: None)
    say("motors")
    motor = calibrate_motors(chain, runs.motor, options.motor) if runs.motor else None
    motors = _motors(chain, motor, runs)
    split = gravity_split(chain, model, l)
    theta_b: Array | None = None
    friction: FrictionResult | None = None
    for _ in range(options.passes):
        say("gravity")
        gravity = calibrate_gravity(chain, model, split, motors, runs.gravity, options.gravity, theta_b)
        say("friction")
        known = split.from_phi() @ gravity.estimate.values
        friction = calibrate_friction(
            chain, model, motors, known, runs.friction, options.friction, options.lugre, friction
        )
        say("inertia")
        inertial = calibrate_inertial(
            chain, model, motors, gravity, friction, runs.inertial, options.inertial
        )
        theta_b = inertial.theta_b
    assert friction is not None
    return FourSteps(motor, motors, gravity, friction, inertial)


def _motors(chain: Chain, motor: MotorResult | None, runs: Runs) -> Motors:
    """Identified constants, or ones where every log holds torques; InputError where currents stay unexplained."""
    logs = [run.log for step in (runs.gravity, runs.friction, runs.inertial) for run in step]
    quantities = sorted(dict.fromkeys(log.quantity for log in logs))
    if motor is None:
        if "current" in quantities:
            raise InputError(
                "the logs hold currents, but there is no motor run", "add sweeps with a known load"
            )
        return Motors.torques(len(chain))
    if quantities != ["current"]:
        raise InputError(f"motor runs are given, but the other logs hold {', '.join(quantities)}")
    missing = [name for name, seen in zip(chain.joint_names, motor.identified, strict=True) if not seen]
    if missing:
        raise InputError(
            f"joint(s) {', '.join(missing)}: torque constant unidentifiable, so currents cannot become torques",
            "use a load whose centre of mass lies beside the joint's axis, or log torques",
        )
    return Motors(motor.torque_constant, np.abs(motor.std / motor.torque_constant))
