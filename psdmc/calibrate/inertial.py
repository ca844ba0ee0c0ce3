"""Step four: the inertial parameters from fast motion, relieved of what the steps before know, (21).

Every prediction passes through the same filter as the measurement, and at the same time: a current that is read late is
compared with a prediction read late.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibrate.filter import States, filtered, held_out, thinned
from psdmc.calibrate.friction import FrictionResult
from psdmc.calibrate.friction_fit import JointFriction
from psdmc.calibrate.gravity import GravityResult
from psdmc.calibrate.least_squares import Consider, Estimate, estimate, noise_warnings
from psdmc.calibrate.log import Array
from psdmc.calibrate.log_checks import checked
from psdmc.calibrate.lugre import Lugre, friction_torque
from psdmc.calibrate.motor_model import Motors
from psdmc.calibrate.predictor import Regressor, payload_torque
from psdmc.calibrate.quality import quality
from psdmc.calibrate.steps import InertialRun, JointQuality, Sample, StepOptions, StepQuality
from psdmc.robot.chain import Chain

FRICTION_STEP = 0.1
"""Finite difference in standard deviations of a friction parameter, for its effect on the torque."""


@dataclass(frozen=True, slots=True, eq=False)
class InertialResult:
    """theta_b complete.

    theta_b      (l,)    gravity and inertial parameters together
    covariance   (l, l)  with the uncertainty of torque constants, gravity and friction
    identifiable (l,)
    estimate     of psi, the parameters that gravity does not show
    inertial     R^2 of what is left for inertia;  everything  of the whole torque
    """

    theta_b: Array
    covariance: Array
    identifiable: NDArray[np.bool_]
    estimate: Estimate
    inertial: StepQuality
    everything: StepQuality
    warnings: tuple[str, ...]

    @property
    def std(self) -> Array:
        return np.where(self.identifiable, np.sqrt(np.maximum(np.diag(self.covariance), 0.0)), np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """One run's independent samples: torque (N, n) and its parts, all filtered alike."""

    time: Array
    torque: Array
    known: Array
    columns: Array
    friction: Array
    friction_columns: Array


def calibrate_inertial(
    chain: Chain,
    model: Regressor,
    motors: Motors,
    gravity: GravityResult,
    friction: FrictionResult,
    runs: Sequence[InertialRun],
    options: StepOptions,
) -> InertialResult:
    """psi by linear least squares, and theta_b with what gravity found."""
    split = gravity.split
    parts = [_rows(chain, model, motors, friction, run, options) for run in runs]
    torque, known, columns, rubbed, rub_columns = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("torque", "known", "columns", "friction", "friction_columns")
    )
    time = np.concatenate([part.time for part in parts])
    static = columns @ (split.from_phi() @ gravity.estimate.values) + known
    target = torque - static - rubbed
    free = columns @ split.from_psi()
    out = held_out(len(target), options.split)
    consider = _considered(motors, gravity, friction, columns, torque, rubbed, rub_columns)
    kept = np.repeat(~out[:, None], len(chain), axis=1)
    solved = estimate(free, target, options.fit, consider, kept)
    theta_b = split.from_phi() @ gravity.estimate.values + split.from_psi() @ solved.values
    predicted = free @ solved.values
    return InertialResult(
        theta_b=theta_b,
        covariance=_combined(motors, gravity, friction, solved),
        identifiable=_identifiable(gravity, solved),
        estimate=solved,
        inertial=_judged("Inertial", chain, time, target, predicted, out),
        everything=_judged("All", chain, time, torque, predicted + static + rubbed, out),
        warnings=_warnings(chain, gravity, solved),
    )


def _rows(
    chain: Chain,
    model: Regressor,
    motors: Motors,
    friction: FrictionResult,
    run: InertialRun,
    options: StepOptions,
) -> _Rows:
    states = filtered(checked(run.log, chain, options.filter.cutoff), options.filter)
    at = thinned(states, options.filter)
    late = _Late(states, friction.delay, at)
    known = np.zeros_like(states.q)
    if run.tool is not None:
        known = payload_torque(chain, states.q, run.tool.mass, run.tool.com)
    columns = model.regressor(states.q, states.qd, states.qdd)
    rubbed = np.zeros_like(states.q)
    slopes: list[Array] = []
    for k, name in enumerate(chain.joint_names):
        if name in friction.joints:
            rubbed[:, k] = friction_torque(friction.joints[name].friction, states.qd[:, k], states.period)
            slopes += [
                late(slope, k) for slope in _friction_slopes(friction.joints[name], states, k, rubbed[:, k])
            ]
    return _Rows(
        time=states.time[at],
        torque=motors.torque(states.effort)[at],
        known=late(known),
        columns=np.stack([late(columns[:, :, j]) for j in range(columns.shape[2])], axis=-1),
        friction=late(rubbed),
        friction_columns=np.stack(slopes, axis=-1) if slopes else np.zeros((len(at), len(chain), 0)),
    )


class _Late:
    """A prediction as the log would hold it: read late, filtered, one row per independent sample."""

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


def _friction_slopes(found: JointFriction, states: States, k: int, base: Array) -> list[Array]:
    """d torque / d parameter for each of the seven, by one-sided differences that keep the bounds."""
    slopes = []
    values, std = found.friction.as_array(), found.std
    for j in range(7):
        step = FRICTION_STEP * min(std[j], 0.5 * abs(values[j])) or 1e-6 * max(abs(values[j]), 1e-6)
        moved = values.copy()
        moved[j] += step if j != 0 or values[0] + step <= values[1] else -step
        changed = friction_torque(Lugre(*moved.tolist()), states.qd[:, k], states.period)
        slopes.append((changed - base) / (moved[j] - values[j]))
    return slopes


def _considered(
    motors: Motors,
    gravity: GravityResult,
    friction: FrictionResult,
    columns: Array,
    torque: Array,
    rubbed: Array,
    rub_columns: Array,
) -> Consider:
    """Effects of torque constants, phi and friction on (prediction - target); constants move all three."""
    n = len(motors.relative_std)
    by_phi = columns @ gravity.split.from_phi()
    by_constant = by_phi @ gravity.estimate.considered - (torque - rubbed)[:, :, None] * np.eye(n)
    stacked = np.concatenate([by_constant, by_phi, rub_columns], axis=2)
    return Consider(stacked, _source_covariance(motors, gravity, friction))


def _source_covariance(motors: Motors, gravity: GravityResult, friction: FrictionResult) -> Array:
    blocks = [np.diag(motors.relative_std**2), gravity.estimate.covariance]
    blocks += [joint.covariance for joint in friction.joints.values()]
    size = sum(len(block) for block in blocks)
    covariance = np.zeros((size, size))
    start = 0
    for block in blocks:
        covariance[start : start + len(block), start : start + len(block)] = block
        start += len(block)
    return covariance


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
    """A theta_b entry counts where all that it hangs on does."""
    split = gravity.split
    seen = np.ones(len(split.pivots) + len(split.rest), dtype=bool)
    seen[split.rest] = solved.identifiable
    unseen_rest = np.abs(split.dependence[:, ~solved.identifiable]).sum(axis=1) > 0
    seen[split.pivots] = gravity.estimate.identifiable & ~unseen_rest
    return seen


def _judged(
    step: str, chain: Chain, time: Array, measured: Array, predicted: Array, out: NDArray[np.bool_]
) -> StepQuality:
    joints: dict[str, JointQuality] = {}
    samples: list[Sample] = []
    for k, name in enumerate(chain.joint_names):
        m, p = measured[:, k], predicted[:, k]
        joints[name] = JointQuality(quality(m[~out], p[~out]), quality(m[out], p[out]))
        samples.append(Sample(name, "time [s]", time, m, p, out))
    return StepQuality(step, joints, tuple(samples))


def _warnings(chain: Chain, gravity: GravityResult, solved: Estimate) -> tuple[str, ...]:
    warnings = []
    unseen = gravity.split.rest[~solved.identifiable]
    if len(unseen):
        names = ", ".join(f"theta_{k + 1}" for k in unseen)
        warnings.append(f"inertial: {names} unidentifiable: rank {solved.rank} of {len(gravity.split.rest)}")
    return (*warnings, *noise_warnings("inertial", chain.joint_names, solved))
