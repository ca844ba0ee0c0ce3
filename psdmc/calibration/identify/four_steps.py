"""The four steps of the calibration in Denso-2022: motors, gravity, friction, inertia."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.friction import FrictionResult, calibrate_friction, prepared_runs
from psdmc.calibration.identify.gravity import GravityResult, calibrate_gravity, gravity_split
from psdmc.calibration.identify.inertial import InertialResult, calibrate_inertial
from psdmc.calibration.identify.motor import MotorResult, calibrate_motors
from psdmc.calibration.identify.motor_constants import one_quantity, refuse_constants, require_constants
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.steps import (
    CalibrationOptions,
    FrictionRun,
    GravityRun,
    InertialRun,
    MotorRun,
)
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.logs.log_checks import checked
from psdmc.errors import InputError
from psdmc.progress import Progress
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """All logs of a campaign, sorted by the calibration step that uses them: motor, gravity, friction, inertial."""

    motor: Sequence[MotorRun]
    gravity: Sequence[GravityRun]
    friction: Sequence[FrictionRun]
    inertial: Sequence[InertialRun]


@dataclass(frozen=True, slots=True, eq=False)
class FourSteps:
    """The results of the four steps motors, gravity, friction and inertia; `motor` is None if the logs hold torques."""

    motor: MotorResult | None
    motors: Motors
    gravity: GravityResult
    friction: FrictionResult
    inertial: InertialResult

    @property
    def warnings(self) -> tuple[str, ...]:
        found = self.motor.warnings if self.motor is not None else ()
        return (*found, *self.gravity.warnings, *self.friction.warnings, *self.inertial.warnings)


def checked_runs(chain: Mechanism, runs: Runs, options: CalibrationOptions) -> tuple[Log, ...]:
    """Return all logs of a campaign after checking them. Raises InputError if there are too few runs (recorded motions)
    or if a log cannot be used."""
    _require_runs(runs)
    logs = [(log, options.motor) for run in runs.motor for log in (run.unloaded, run.loaded)]
    logs += [(run.log, options.gravity) for run in runs.gravity]
    logs += [(run.log, options.friction) for run in runs.friction]
    logs += [(run.log, options.inertial) for run in runs.inertial]
    return tuple(checked(log, chain, step.filter.cutoff) for log, step in logs)


def calibrate_four_steps(
    chain: Mechanism,
    model: Regressor,
    l: int,
    runs: Runs,
    options: CalibrationOptions | None = None,
    progress: Progress | None = None,
    torque_constants: Mapping[str, float] | None = None,
    file_theta: Array | None = None,
) -> FourSteps:
    """Return torque constants, gravity parameters, friction and inertial parameters from the runs of a campaign. The
    last three are determined repeatedly, as often as the options say.

    torque_constants  N m/A by joint name, for joints on which the weight of the load does not act (an axis along
                      gravity)
    file_theta        (l,) the l base parameters of the robot file, which remain in directions (linear combinations)
                      that no run determines; None: zero
    """
    options = options or CalibrationOptions()
    say = progress or (lambda step: None)
    _require_runs(runs)
    say("motors")
    motor = calibrate_motors(chain, runs.motor, options.motor) if runs.motor else None
    motors = _motors(chain, motor, runs, torque_constants or {})
    split = gravity_split(chain, model, l)
    theta_b: Array | None = None
    friction: FrictionResult | None = None
    for _ in range(options.passes):
        say("gravity")
        gravity = calibrate_gravity(
            chain, model, split, motors, runs.gravity, options.gravity, theta_b, file_theta
        )
        say("friction")
        known = split.from_phi() @ gravity.estimate.values
        alone = prepared_runs(chain, model, motors, known, runs.friction, options.friction)
        friction = calibrate_friction(alone, options.lugre, friction)
        say("inertia")
        inertial = calibrate_inertial(
            chain, model, motors, gravity, friction, runs.inertial, options.inertial, file_theta
        )
        theta_b = inertial.theta_b
    assert friction is not None
    return FourSteps(motor, motors, gravity, friction, inertial)


def _require_runs(runs: Runs) -> None:
    """InputError where a step that later ones need has no run."""
    steps = {"gravity": runs.gravity, "friction": runs.friction, "inertial": runs.inertial}
    missing = [step for step, own in steps.items() if not own]
    if missing:
        raise InputError(
            f"the campaign has no {' and no '.join(missing)} run",
            "`psdmc excite` plans all four steps; one log alone is calibrated when it is given instead of a campaign",
        )


def _motors(chain: Mechanism, motor: MotorResult | None, runs: Runs, given: Mapping[str, float]) -> Motors:
    """Identified torque constants, given ones where none was identified, and one for each joint where logs hold torques.

    Raises InputError where the logs hold currents without a constant.
    """
    require_constants(given, chain.joint_names)
    logs = [run.log for step in (runs.gravity, runs.friction, runs.inertial) for run in step]
    quantity = one_quantity(logs)
    if quantity != "current":
        refuse_constants(given, logs[0])
        if motor is not None:
            raise InputError(
                f"{logs[0].name}: holds {quantity}, but there are motor runs",
                "log currents in every run, or leave the motor runs out",
            )
        return Motors.torques(len(chain))
    constant, relative = np.full(len(chain), np.nan), np.zeros(len(chain))
    if motor is not None:
        constant = np.array(motor.torque_constant)
        relative = np.where(motor.identified, np.abs(motor.std / constant), 0.0)
    for k, name in enumerate(chain.joint_names):
        if np.isnan(constant[k]) and name in given:
            constant[k] = given[name]
    missing = [name for name, value in zip(chain.joint_names, constant, strict=True) if np.isnan(value)]
    if missing:
        why = "unidentifiable" if motor is not None else "unknown, for there is no motor run"
        raise InputError(
            f"joint(s) {', '.join(missing)}: torque constant {why}, so currents cannot become torques",
            "use a load that these joints feel, give --torque-constants for them, or log torques",
        )
    return Motors(constant, relative)
