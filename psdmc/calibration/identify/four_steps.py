"""The four steps of the calibration in Denso-2022: motors, gravity, friction, inertia.

The result can be made physically consistent. Base parameters theta_b and LuGre friction (a friction model with
bristles) then form one vector, and each step contributes a cost for changes of the vector.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.calibration.identify.friction import (
    FrictionResult,
    JointFriction,
    calibrate_friction,
    prepared_runs,
    step_sizes,
    to_seven,
    unknowns_of,
)
from psdmc.calibration.identify.gravity import GravityResult, calibrate_gravity, gravity_split
from psdmc.calibration.identify.inertial import InertialResult, calibrate_inertial
from psdmc.calibration.identify.motor import MotorResult, calibrate_motors
from psdmc.calibration.identify.motor_model import Motors, one_quantity, refuse_constants, require_constants
from psdmc.calibration.identify.physical import nearest_physical, whitening_of
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.steps import (
    CalibrationOptions,
    FrictionRun,
    GravityRun,
    InertialRun,
    MotorRun,
    Robot,
)
from psdmc.calibration.logs.log import Array, Log
from psdmc.calibration.logs.log_checks import checked
from psdmc.errors import InputError
from psdmc.friction.terms import STATE_LAW
from psdmc.links.pseudo_inertias import PhysicalOptions
from psdmc.model.dynamics_model import DynamicsModel
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
    """The results of the four steps motors, gravity, friction and inertia; `motor` is None if the logs hold torques.

    logs  all logs of the campaign, after they were checked
    """

    logs: tuple[Log, ...]
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
    last three are determined repeatedly, as often as the options say. Raises InputError if there are too few runs
    (recorded motions), or if a log cannot be used.

    torque_constants  N m/A by joint name, for joints on which the weight of the load does not act (an axis along
                      gravity)
    file_theta        (l,) the l base parameters of the robot file, which remain in directions (linear combinations)
                      that no run determines; None: zero
    """
    options = options or CalibrationOptions()
    say = progress or (lambda step: None)
    say("checking logs")
    steps = {"gravity": runs.gravity, "friction": runs.friction, "inertial": runs.inertial}
    missing = [step for step, own in steps.items() if not own]
    if missing:
        raise InputError(
            f"the campaign has no {' and no '.join(missing)} run",
            "`psdmc excite` plans all four steps; one log alone is calibrated when it is given instead of a campaign",
        )
    logs = [(log, options.motor) for run in runs.motor for log in (run.unloaded, run.loaded)]
    logs += [(run.log, options.gravity) for run in runs.gravity]
    logs += [(run.log, options.friction) for run in runs.friction]
    logs += [(run.log, options.inertial) for run in runs.inertial]
    checked_logs = tuple(checked(log, chain, step.filter.cutoff) for log, step in logs)
    say("motors")
    motor = calibrate_motors(chain, runs.motor, options.motor) if runs.motor else None
    motors = _motors(chain, motor, runs, torque_constants or {})
    robot, split = Robot(chain, model, motors), gravity_split(chain, model, l)
    theta_b: Array | None = None
    friction: FrictionResult | None = None
    for _ in range(options.passes):
        say("gravity")
        gravity = calibrate_gravity(robot, split, runs.gravity, options.gravity, theta_b, file_theta)
        say("friction")
        known = split.from_phi() @ gravity.estimate.values
        alone = prepared_runs(robot, known, runs.friction, options.friction)
        friction = calibrate_friction(alone, options.lugre, friction)
        say("inertia")
        inertial = calibrate_inertial(robot, gravity, friction, runs.inertial, options.inertial, file_theta)
        theta_b = inertial.theta_b
    assert friction is not None
    return FourSteps(checked_logs, motor, motors, gravity, friction, inertial)


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
    unknown = np.full(len(chain), np.nan)
    motors = (motor or MotorResult(unknown, unknown, ())).motors(chain.joint_names, given)
    constants = zip(chain.joint_names, motors.torque_constant, strict=True)
    missing = [name for name, value in constants if np.isnan(value)]
    if missing:
        why = "unidentifiable" if motor is not None else "unknown, for there is no motor run"
        raise InputError(
            f"joint(s) {', '.join(missing)}: torque constant {why}, so currents cannot become torques",
            "use a load that these joints feel, give --torque-constants for them, or log torques",
        )
    return motors


# Made physically consistent


SEVEN = 7
NEVER_NEGATIVE = tuple(not value.logarithmic for value in STATE_LAW.values)
"""Of F_c, F_s - F_c, ln v_s, F_v, d_v, ln sigma_0, sigma_1. By the logarithms v_s and sigma_0 are positive; F_s >= F_c."""
NEAR = 0.5
"""Step sizes by which a friction parameter may change that its run does not show: the relative standard deviation from
which it is called unseen."""
HELD = 1e-6
"""Step sizes by which a parameter may change that the friction law fixes: none, to the solver's accuracy."""
SMALLEST = np.where(NEVER_NEGATIVE, STATE_LAW.bounds[0], -np.inf)
"""Of the seven, as the friction run's own bounds, so that a value that the solver leaves on a bound is one of the law's."""


@dataclass(frozen=True, slots=True, eq=False)
class PhysicalSteps:
    """The physically possible result of a four-step calibration (motors, gravity, friction, inertia).

    theta_b   (l,) base parameters
    found     results of the four steps, with friction adapted to theta_b
    distance  distance from the unconstrained result, in standard deviations
    """

    theta_b: Array
    found: FourSteps
    distance: float


def physical_steps(
    model: DynamicsModel, found: FourSteps, options: PhysicalOptions | None = None
) -> PhysicalSteps:
    """Return the physically possible base parameters theta_b and LuGre friction nearest to the result of a calibration.

    The calibration has four steps: motors, gravity, friction and inertia. The cost of a change is the sum of three
    costs, those of gravity, friction and inertia. The first is for phi, the base parameters that affect gravity. The
    second is for each joint's seven friction parameters. The third is for psi, the other base parameters, whose
    estimate depends on phi and friction. So friction adapts to a change of theta_b, as far as the friction runs allow.
    Torque constants do not change.
    """
    joints = found.friction.joints
    unknowns = {name: unknowns_of(joint)[:SEVEN] for name, joint in joints.items()}
    vector = np.concatenate([found.inertial.theta_b, *unknowns.values()])
    bounded = np.concatenate([np.zeros(model.l, dtype=bool), np.tile(NEVER_NEGATIVE, len(joints))])
    near = nearest_physical(model, vector, _whitening(found, len(vector)), bounded, options)
    moved = {}
    for (name, joint), seven in zip(joints.items(), near.values[model.l :].reshape(-1, SEVEN), strict=True):
        fixed = np.diag(joint.covariance) == 0.0
        kept = np.where(fixed, unknowns[name], np.maximum(seven, SMALLEST))
        moved[name] = replace(joint, friction=STATE_LAW.from_unknowns(kept))
    friction = FrictionResult(moved, found.friction.warnings)
    return PhysicalSteps(near.values[: model.l], replace(found, friction=friction), near.distance)


def _whitening(found: FourSteps, size: int) -> Array:
    """W with |W d|^2 the steps' summed cost of a change d of the vector, in variances."""
    inertial, split = found.inertial, found.gravity.split
    l, r, n = len(inertial.theta_b), len(split.pivots), len(found.motors.relative_std)
    joints = list(found.friction.joints.values())
    by_phi = np.zeros((r, size))
    by_phi[:, split.pivots], by_phi[:, split.rest] = np.eye(r), split.dependence
    by_psi = np.zeros((len(split.rest), size))
    by_psi[:, split.rest] = np.eye(len(split.rest))
    moves = inertial.estimate.considered
    by_psi -= moves[:, n : n + r] @ by_phi
    own = []
    for k, joint in enumerate(joints):
        place = slice(l + SEVEN * k, l + SEVEN * (k + 1))
        turn = to_seven(joint.friction)[:, :SEVEN]
        by_psi[:, place] -= moves[:, n + r + SEVEN * k : n + r + SEVEN * (k + 1)] @ turn
        rows = np.zeros((2 * SEVEN, size))
        rows[:, place] = _friction_rows(joint, turn)
        own.append(rows)
    return np.vstack([found.gravity.estimate.whitening @ by_phi, inertial.estimate.whitening @ by_psi, *own])


def _friction_rows(joint: JointFriction, turn: Array) -> Array:
    """(14, 7) of one joint: its run's cost, and rows that keep the values that the run does not show."""
    back = np.linalg.inv(turn)
    covariance = back @ joint.covariance @ back.T
    free = np.flatnonzero(np.diag(covariance) > 0)
    rows = np.zeros((2 * SEVEN, SEVEN))
    rows[np.ix_(free, free)] = whitening_of(covariance[np.ix_(free, free)])
    reach = step_sizes(unknowns_of(joint))[:SEVEN] * np.where(np.diag(covariance) > 0, NEAR, HELD)
    rows[SEVEN:] = np.diag(1.0 / reach)
    return rows
