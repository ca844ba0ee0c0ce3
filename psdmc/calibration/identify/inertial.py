"""Step four of the calibration: determines the inertial parameters from fast motion, after the torques of gravity and
friction are subtracted. Source: Denso-2022, (21).

Every predicted torque is filtered and delayed in time as the measured torque is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from psdmc.calibration.identify.estimate import Consider, Estimate, Prior, base_parameter_scale, torque_sizes
from psdmc.calibration.identify.friction import FrictionResult, JointFriction
from psdmc.calibration.identify.gravity import GravityResult, gravity_split
from psdmc.calibration.identify.least_squares import estimate
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor, payload_torque
from psdmc.calibration.identify.residuals import noise_warnings
from psdmc.calibration.identify.state_friction import friction_torque
from psdmc.calibration.identify.steps import InertialRun, Robot, StepOptions, judged
from psdmc.calibration.logs.filter import States, filtered, held_out, thinned
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.model.calibrated import StepQuality

FRICTION_STEP = 0.1
"""Step of the finite difference for a friction parameter's effect on the torque, in its standard deviations."""


@dataclass(frozen=True, slots=True, eq=False)
class InertialResult:
    """All l base parameters after step four, theta_b.

    theta_b       (l,)    gravity and inertial parameters together
    covariance    (l, l)  with the uncertainty of torque constants, gravity and friction
    identifiable  (l,)    whether the data determine the parameter by itself
    estimate      estimate of the parameters that do not affect gravity torques
    unseen        (l, k)  k directions (combinations of parameters) that no run determines, in SI units. The length of
                          each is a plausible change
    scale         (l,)    plausible size of each base parameter
    """

    theta_b: Array
    covariance: Array
    identifiable: NDArray[np.bool_]
    estimate: Estimate
    unseen: Array
    scale: Array
    warnings: tuple[str, ...]

    @property
    def prior_covariance(self) -> Array:
        """Return the covariance (l, l) of the l base parameters that comes from the prior, in directions (linear
        combinations) that no run determines."""
        return np.asarray(self.estimate.prior_std**2 * self.unseen @ self.unseen.T)

    @property
    def std(self) -> Array:
        variance = np.diag(self.covariance) + np.diag(self.prior_covariance)
        return np.where(self.identifiable, np.sqrt(np.maximum(variance, 0.0)), np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """One run's independent samples: torque (N, n) and its parts, all filtered alike."""

    time: Array
    torque: Array
    known: Array
    columns: Array
    noise: Array
    friction: Array
    friction_columns: Array


def calibrate_inertial(
    robot: Robot,
    gravity: GravityResult,
    friction: FrictionResult,
    runs: Sequence[InertialRun],
    options: StepOptions,
    file_theta: Array | None = None,
) -> InertialResult:
    """Return the parameters that do not affect gravity torques, by linear least squares, and combine them with the
    gravity parameters to all l base parameters.

    file_theta  (l,) the base parameters of the robot file. They remain in directions (linear combinations) that no run
                determines; None: zero
    """
    split = gravity.split
    rows = _stacked([_rows(robot, friction, run, options) for run in runs])
    static = rows.columns @ (split.from_phi() @ gravity.estimate.values) + rows.known
    target = rows.torque - static - rows.friction
    consider = _considered(robot.motors, gravity, friction, rows)
    out = held_out(len(target), options.split)
    kept = np.repeat(~out[:, None], robot.chain.nv, axis=1)
    scale = base_parameter_scale(robot.chain, robot.regressor, torque_sizes(rows.torque), file_theta)
    start = np.zeros(len(split.rest)) if file_theta is None else file_theta[split.rest]
    prior = Prior(start, scale[split.rest], rows.noise @ split.from_psi())
    solved = estimate(rows.columns @ split.from_psi(), target, options.fit, consider, kept, prior)
    warnings = noise_warnings("inertial", robot.chain.v_names, solved)
    by_phi, by_psi = split.from_phi(), split.from_psi()
    return InertialResult(
        theta_b=by_phi @ gravity.estimate.values + by_psi @ solved.values,
        covariance=_combined(robot.motors, gravity, friction, solved),
        identifiable=_identifiable(gravity, solved),
        estimate=solved,
        unseen=np.hstack([by_phi @ _believable(gravity.estimate), by_psi @ _believable(solved)]),
        scale=scale,
        warnings=warnings,
    )


def _believable(solved: Estimate) -> Array:
    """Unseen directions, SI, scaled to believable lengths."""
    return np.asarray(solved.scale[:, None] * solved.unseen)


def judge_inertial(
    robot: Robot, theta_b: Array, friction: FrictionResult, runs: Sequence[InertialRun], options: StepOptions
) -> tuple[StepQuality, StepQuality]:
    """Return how well the base parameters predict the torques of the fast motion. The first result is for inertial
    torques alone, after gravity and friction are subtracted; the second is for the whole torques."""
    split = gravity_split(robot.chain, robot.regressor, len(theta_b))
    rows = _stacked([_rows(robot, friction, run, options, sensitive=False) for run in runs])
    still = split.from_phi() @ split.phi(theta_b)
    static = rows.columns @ still + rows.known + rows.friction
    moving = rows.columns @ (theta_b - still)
    out = held_out(len(rows.time), options.split)
    names = robot.chain.v_names
    return (
        judged("Inertial", names, rows.time, rows.torque - static, moving, out),
        judged("All", names, rows.time, rows.torque, static + moving, out),
    )


def _stacked(parts: Sequence[_Rows]) -> _Rows:
    """All runs' rows one after the other."""
    return _Rows(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(_Rows)))


def _rows(
    robot: Robot, friction: FrictionResult, run: InertialRun, options: StepOptions, sensitive: bool = True
) -> _Rows:
    """One run's rows; `sensitive` adds noise columns and slopes of friction, which only a fit needs."""
    states = filtered(checked(run.log, robot.chain, options.filter.cutoff), options.filter)
    at = thinned(states, options.filter)
    late = Late(states, friction.delay, at)
    known = np.zeros_like(states.q)
    if run.tool is not None:
        known = payload_torque(robot.chain, states.q, run.tool.mass, run.tool.com)
    columns = _late_columns(robot.regressor, late, (states.q, states.qd, states.qdd))
    by_noise = (
        _late_columns(robot.regressor, late, states.jittered()) - columns
        if sensitive
        else np.zeros_like(columns)
    )
    rubbed = np.zeros_like(states.q)
    slopes: list[Array] = []
    for k, name in enumerate(robot.chain.v_names):
        if name in friction.joints:
            rubbed[:, k] = friction_torque(friction.joints[name].friction, states.qd[:, k], states.period)
            if sensitive:
                own = friction_slopes(friction.joints[name], states.qd[:, k], states.period)
                slopes += [late(slope, k) for slope in own]
    return _Rows(
        time=states.time[at],
        torque=robot.motors.torque(states.effort)[at],
        known=late(known),
        columns=columns,
        noise=by_noise,
        friction=late(rubbed),
        friction_columns=np.stack(slopes, axis=-1) if slopes else np.zeros((len(at), robot.chain.nv, 0)),
    )


def _late_columns(model: Regressor, late: Late, motion: tuple[Array, Array, Array]) -> Array:
    """(rows, n, l) the regressor along a motion, delayed and filtered like a log."""
    columns = model.regressor(*motion)
    return np.stack([late(columns[:, :, j]) for j in range(columns.shape[2])], axis=-1)


class Late:
    """A function that converts predicted torques to what a log would contain. The torques are delayed and filtered, and
    only the rows `at` are kept, which count as independent samples."""

    def __init__(self, states: States, delay: float, at: NDArray[np.intp]) -> None:
        self.states, self.delay, self.at = states, delay, at

    def __call__(self, values: Array, joint: int | None = None) -> Array:
        """(rows, n) of (N, n), or of (N,) for one joint alone."""
        states = self.states
        shape = states.q.shape
        columns = values if joint is None else values[:, None]
        if self.delay:
            later = states.time + self.delay
            columns = np.column_stack([np.interp(later, states.time, column) for column in columns.T])
        rows = states.low_pass(columns)[self.at]
        if joint is None:
            return rows
        spread = np.zeros((len(rows), shape[1]))
        spread[:, joint] = rows[:, 0]
        return spread


def friction_slopes(found: JointFriction, speed: Array, period: float) -> list[Array]:
    """Return the change (N,) of a joint's friction torque per unit of each of the seven values, over its speed. One-sided
    differences keep the bounds."""
    slopes, unmoved = [], friction_torque(found.friction, speed, period)
    values, std = found.friction, found.std
    for j in range(7):
        step = FRICTION_STEP * min(std[j], 0.5 * abs(values[j])) or 1e-6 * max(abs(values[j]), 1e-6)
        moved = values.copy()
        moved[j] += step if j != 0 or values[0] + step <= values[1] else -step
        changed = friction_torque(moved, speed, period)
        slopes.append((changed - unmoved) / (moved[j] - values[j]))
    return slopes


def _considered(motors: Motors, gravity: GravityResult, friction: FrictionResult, rows: _Rows) -> Consider:
    """Effects of torque constants, phi and friction on (prediction - target); constants change all three."""
    n = len(motors.relative_std)
    by_phi = rows.columns @ gravity.split.from_phi()
    moved = (rows.torque - rows.friction)[:, :, None] * np.eye(n)
    by_constant = by_phi @ gravity.estimate.considered - moved
    stacked = np.concatenate([by_constant, by_phi, rows.friction_columns], axis=2)
    return Consider(stacked, _source_covariance(motors, gravity, friction))


def _source_covariance(motors: Motors, gravity: GravityResult, friction: FrictionResult) -> Array:
    own = [joint.covariance for joint in friction.joints.values()]
    return np.asarray(block_diag(np.diag(motors.relative_std**2), gravity.estimate.covariance, *own))


def _combined(motors: Motors, gravity: GravityResult, friction: FrictionResult, solved: Estimate) -> Array:
    """(l, l) covariance of theta_b from its independent sources."""
    split = gravity.split
    n, r = len(motors.relative_std), len(split.pivots)
    by_source = split.from_psi() @ solved.considered
    by_source[:, :n] += split.from_phi() @ gravity.estimate.considered
    by_source[:, n : n + r] += split.from_phi()
    sources = _source_covariance(motors, gravity, friction)
    own = split.from_psi() @ solved.covariance @ split.from_psi().T
    return np.asarray(own + by_source @ sources @ by_source.T)


def _identifiable(gravity: GravityResult, solved: Estimate) -> NDArray[np.bool_]:
    """An entry of theta_b is identifiable where all that it depends on is."""
    split = gravity.split
    seen = np.ones(len(split.pivots) + len(split.rest), dtype=bool)
    seen[split.rest] = solved.identifiable
    unseen_rest = np.abs(split.dependence[:, ~solved.identifiable]).sum(axis=1) > 0
    seen[split.pivots] = gravity.estimate.identifiable & ~unseen_rest
    return seen
