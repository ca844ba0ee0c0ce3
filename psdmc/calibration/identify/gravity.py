"""Step two: determines the gravity parameters from slow motion forwards and backwards. Source: Denso-2022, (18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import Consider, Estimate, Prior, base_parameter_scale, torque_sizes
from psdmc.calibration.identify.least_squares import estimate
from psdmc.calibration.identify.predictor import Regressor, gravity_regressor, payload_torque
from psdmc.calibration.identify.residuals import noise_warnings
from psdmc.calibration.identify.steps import GravityRun, Robot, StepOptions, judged
from psdmc.calibration.logs.filter import States, away_from, filtered, held_out
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.errors import InputError
from psdmc.model.calibrated import StepQuality
from psdmc.robot.mechanism import Mechanism

SAME_PLACE = 5e-3
"""rad or m: how near the way back must pass to the way there."""
STEADY_ACCELERATION = 0.1
"""rad/s^2: below it a joint counts as moving at constant speed."""
MOVING = 0.02
"""rad/s: below it a joint counts as standing, where static friction hides gravity."""
DEPENDENT = 1e-8
"""A gravity column counts as new where this share of it is left beside the columns before it."""


@dataclass(frozen=True, slots=True, eq=False)
class GravitySplit:
    """A split of theta_b (the l base parameters) into two groups. phi are r combinations that affect gravity torques;
    psi are the l - r other entries of theta_b.

    pivots      (r,)     indices of the entries of theta_b that phi consists of, together with multiples of psi
    rest        (l-r,)   indices of the other entries, psi
    dependence  (r, l-r) phi = theta_b[pivots] + dependence @ theta_b[rest]
    """

    pivots: NDArray[np.intp]
    rest: NDArray[np.intp]
    dependence: Array

    def from_phi(self) -> Array:
        """Return the derivatives (l, r) of theta_b (the l base parameters) by phi at constant psi. phi are the r
        combinations that affect gravity torques, psi the other entries."""
        matrix = np.zeros((len(self.pivots) + len(self.rest), len(self.pivots)))
        matrix[self.pivots] = np.eye(len(self.pivots))
        return matrix

    def from_psi(self) -> Array:
        """Return the derivatives (l, l-r) of theta_b (the l base parameters) by psi at constant phi. phi are the r
        combinations that affect gravity torques, psi the other entries."""
        matrix = np.zeros((len(self.pivots) + len(self.rest), len(self.rest)))
        matrix[self.rest] = np.eye(len(self.rest))
        matrix[self.pivots] = -self.dependence
        return matrix

    def phi(self, theta_b: Array) -> Array:
        return np.asarray(theta_b[self.pivots] + self.dependence @ theta_b[self.rest])


@dataclass(frozen=True, slots=True, eq=False)
class GravityResult:
    """The gravity parameters phi (the combinations of base parameters that affect gravity torques), with their
    uncertainty.

    split     how the base parameters are split into phi and other entries
    estimate  phi. Its field `considered` is d phi per relative change of each torque constant, (r values of phi, n
              joints)
    """

    split: GravitySplit
    estimate: Estimate
    warnings: tuple[str, ...]


def gravity_split(chain: Mechanism, model: Regressor, l: int, seed: int = 0) -> GravitySplit:
    """Return the split of theta_b (the base parameters) into combinations that affect gravity torques and other
    entries. Entry j is a pivot (part of a combination) if column j of the gravity regressor is linearly independent of
    the earlier columns."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (max(4 * l, 40), len(chain)))
    columns = gravity_regressor(model, q).reshape(-1, l)
    pivots: list[int] = []
    basis = np.zeros((len(columns), 0))
    for j in range(l):
        column = columns[:, j]
        left = column - basis @ (basis.T @ column)
        left = left - basis @ (basis.T @ left)
        size = float(np.linalg.norm(column))
        if size > 1e-12 and np.linalg.norm(left) > DEPENDENT * size:
            basis = np.column_stack([basis, left / np.linalg.norm(left)])
            pivots.append(j)
    rest = [j for j in range(l) if j not in pivots]
    dependence = np.asarray(
        np.linalg.lstsq(columns[:, pivots], columns[:, rest], rcond=None)[0], dtype=np.float64
    )
    dependence[np.abs(dependence) < DEPENDENT] = 0.0
    return GravitySplit(np.array(pivots, dtype=np.intp), np.array(rest, dtype=np.intp), dependence)


def calibrate_gravity(
    robot: Robot,
    split: GravitySplit,
    runs: Sequence[GravityRun],
    options: StepOptions,
    theta_b: Array | None = None,
    file_theta: Array | None = None,
) -> GravityResult:
    """Return the gravity parameters phi (combinations of base parameters that affect gravity torques) by linear least
    squares. The torques are averaged over both directions of motion, which cancels friction.

    theta_b     base parameters from an earlier iteration: their velocity and acceleration torques are subtracted; None:
                none
    file_theta  the base parameters of the robot file. They remain in directions (linear combinations) that no run
                determines; None: zero
    """
    q, target, use, currents = _even_parts(robot, runs, options, theta_b)
    columns = gravity_regressor(robot.regressor, q)[:, :, split.pivots]
    out = held_out(len(q), options.split)
    kept = use & ~out[:, None]
    consider = Consider(
        -currents[:, :, None] * np.eye(len(robot.chain)), np.diag(robot.motors.relative_std**2)
    )
    scale = base_parameter_scale(robot.chain, robot.regressor, torque_sizes(currents), file_theta)[
        split.pivots
    ]
    start = np.zeros(len(scale)) if file_theta is None else split.phi(file_theta)
    solved = estimate(columns, target, options.fit, consider, kept, Prior(start, scale))
    return GravityResult(split, solved, noise_warnings("gravity", robot.chain.joint_names, solved))


def judge_gravity(
    robot: Robot, runs: Sequence[GravityRun], options: StepOptions, theta_b: Array
) -> StepQuality:
    """Return how well the base parameters predict gravity torques. The measured torques are averaged over both
    directions of motion, which cancels friction."""
    q, target, use, _ = _even_parts(robot, runs, options, theta_b)
    out = held_out(len(q), options.split)
    predicted = gravity_regressor(robot.regressor, q) @ theta_b
    row = np.arange(len(q), dtype=np.float64)
    return judged("Gravity", robot.chain.joint_names, row, target, predicted, out, use, "sample")


def _even_parts(
    robot: Robot, runs: Sequence[GravityRun], options: StepOptions, theta_b: Array | None
) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """All runs' rows one after the other: position, torque without friction, usable entries, total motor torque."""
    parts = [_even_part(robot, run, options, theta_b) for run in runs]
    q, target, use, torque = (np.concatenate(x) for x in zip(*parts, strict=True))
    return q, target, use, torque


def _even_part(
    robot: Robot, run: GravityRun, options: StepOptions, theta_b: Array | None
) -> tuple[Array, Array, NDArray[np.bool_], Array]:
    """Mean position, torque without friction, usable entries and total motor torque, one row per independent sample."""
    states = filtered(checked(run.log, robot.chain, options.filter.cutoff), options.filter)
    there, back = _pairs(states, options)
    torque = robot.motors.torque(states.effort)
    target = torque.copy()
    if theta_b is not None:
        full = robot.regressor.regressor(
            states.q[[*there, *back]], states.qd[[*there, *back]], states.qdd[[*there, *back]]
        )
        still = gravity_regressor(robot.regressor, states.q[[*there, *back]])
        target[[*there, *back]] -= (full - still) @ theta_b
    if run.tool is not None:
        target -= payload_torque(robot.chain, states.q, run.tool.mass, run.tool.com)
    turning = np.any(np.abs(states.qdd) >= STEADY_ACCELERATION, axis=1)
    steady = away_from(turning, options.filter, states.period)
    moves = np.abs(states.qd) > MOVING
    near = np.all(np.abs(states.q[there] - states.q[back]) < SAME_PLACE, axis=1)
    use = (near & steady[there] & steady[back])[:, None] & moves[there] & moves[back]
    if use.sum() < 10 * len(robot.chain):
        raise InputError(
            f"{run.log.name}: the backward sweep does not follow the forward sweep at constant speed",
            "gravity needs each path run forwards and backwards, slowly: `psdmc excite` plans such runs",
        )
    return (
        0.5 * (states.q[there] + states.q[back]),
        0.5 * (target[there] + target[back]),
        use,
        0.5 * (torque[there] + torque[back]),
    )


def _pairs(states: States, options: StepOptions) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of the way there and the rows of the way back at the same place, one cut-off's independence apart."""
    last = len(states.time) - 1
    step = max(1, int(np.floor(0.5 / (options.filter.cutoff * states.period))))
    there = np.flatnonzero(states.use[: last // 2 + 1])[::step]
    return there, last - there
