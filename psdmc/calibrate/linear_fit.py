"""Everything linear at once, from one log: base parameters, Coulomb and viscous friction, offsets.

The alternative to the four steps where a robot gives a single exciting log and torques, or currents with known
constants. Regressor and friction columns pass through the filter that the measurement passed through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from psdmc.calibrate.filter import FilterOptions, SplitOptions, States, filtered, held_out, thinned
from psdmc.calibrate.least_squares import Consider, Estimate, FitOptions, estimate, noise_warnings
from psdmc.calibrate.log import Array, Log
from psdmc.calibrate.log_checks import CheckOptions, checked
from psdmc.calibrate.motor_model import Motors
from psdmc.calibrate.predictor import Regressor
from psdmc.calibrate.quality import quality
from psdmc.calibrate.steps import JointQuality, Sample, StepQuality
from psdmc.robot.chain import Chain

FRICTION_COLUMNS = ("coulomb", "viscous", "offset")


@dataclass(frozen=True, slots=True)
class LinearOptions:
    """One log, one linear fit.

    exponents       of the viscous terms |qd|^d sign(qd), each with a coefficient of its own; the first is `viscous`
    sign_speed      rad/s over which Coulomb friction changes sign: tanh(qd / sign_speed)
    offset          whether each joint's torque has a constant of its own
    """

    filter: FilterOptions = field(default_factory=lambda: FilterOptions(cutoff=8.0))
    split: SplitOptions = field(default_factory=lambda: SplitOptions(held_out=0.3, blocks=0))
    fit: FitOptions = field(default_factory=lambda: FitOptions(method="irls"))
    check: CheckOptions = field(default_factory=CheckOptions)
    exponents: tuple[float, ...] = (1.0,)
    sign_speed: float = 0.03
    offset: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class LinearResult:
    """theta_b and simple friction.

    theta_b, std   (l,)    SI; std infinite where unidentifiable
    friction       (n, 2 + exponents)  Coulomb (N m), viscous terms (N m (s/rad)^d), offset (N m)
    friction_std   the same shape
    """

    theta_b: Array
    estimate: Estimate
    friction: Array
    friction_std: Array
    friction_names: tuple[str, ...]
    quality: StepQuality
    warnings: tuple[str, ...]
    problem: LinearProblem

    @property
    def std(self) -> Array:
        return self.estimate.std[: len(self.theta_b)]

    @property
    def identifiable(self) -> NDArray[np.bool_]:
        return self.estimate.identifiable[: len(self.theta_b)]


@dataclass(frozen=True, slots=True, eq=False)
class LinearProblem:
    """The stacked rows: columns (N, n, l + friction), torque (N, n), which rows are held out."""

    chain: Chain
    time: Array
    columns: Array
    torque: Array
    held_out: NDArray[np.bool_]
    l: int

    def qualities(self, values: Array) -> StepQuality:
        """Torques predicted with these values of all unknowns, against the measured ones."""
        predicted = self.columns @ values
        joints: dict[str, JointQuality] = {}
        samples: list[Sample] = []
        out = self.held_out
        for k, name in enumerate(self.chain.joint_names):
            m, p = self.torque[:, k], predicted[:, k]
            joints[name] = JointQuality(quality(m[~out], p[~out]), quality(m[out], p[out]))
            samples.append(Sample(name, "time [s]", self.time, m, p, out))
        return StepQuality("All", joints, tuple(samples))


def calibrate_linear(
    chain: Chain,
    model: Regressor,
    l: int,
    logs: Sequence[Log],
    options: LinearOptions | None = None,
    motors: Motors | None = None,
) -> LinearResult:
    """Base parameters and simple friction by linear least squares; InputError where a log cannot be used."""
    options = options or LinearOptions()
    motors = motors or Motors.torques(len(chain))
    checked_logs = [checked(log, chain, options.filter.cutoff, options.check) for log in logs]
    problem = linear_problem(chain, model, l, checked_logs, options, motors)
    kept = np.repeat(~problem.held_out[:, None], len(chain), axis=1)
    scale = -problem.torque[:, :, None] * np.eye(len(chain))
    consider = Consider(scale, np.diag(motors.relative_std**2))
    solved = estimate(problem.columns, problem.torque, options.fit, consider, kept)
    names = friction_names(options)
    shape = (len(chain), len(names))
    return LinearResult(
        theta_b=solved.values[:l],
        estimate=solved,
        friction=solved.values[l:].reshape(shape),
        friction_std=solved.std[l:].reshape(shape),
        friction_names=names,
        quality=problem.qualities(solved.values),
        warnings=(*_notes(checked_logs), *_warnings(chain, solved, l)),
        problem=problem,
    )


def friction_names(options: LinearOptions) -> tuple[str, ...]:
    """Names of a joint's friction columns, in order."""
    viscous = tuple("viscous" if k == 0 else f"viscous^{d:g}" for k, d in enumerate(options.exponents))
    return ("coulomb", *viscous, *(("offset",) if options.offset else ()))


def linear_problem(
    chain: Chain, model: Regressor, l: int, logs: Sequence[Log], options: LinearOptions, motors: Motors
) -> LinearProblem:
    """The stack of all logs' independent samples; every log is split on its own."""
    times, columns, torques, outs = [], [], [], []
    for log in logs:
        states = filtered(log, options.filter, options.check)
        at = thinned(states, options.filter)
        times.append(states.time[at])
        columns.append(_columns(model, states, at, options))
        torques.append(motors.torque(states.effort)[at])
        outs.append(held_out(len(at), options.split))
    return LinearProblem(
        chain,
        np.concatenate(times),
        np.concatenate(columns),
        np.concatenate(torques),
        np.concatenate(outs),
        l,
    )


def _columns(model: Regressor, states: States, at: NDArray[np.intp], options: LinearOptions) -> Array:
    """(rows, n, l + n f) filtered like the torque."""
    rigid = model.regressor(states.q, states.qd, states.qdd)
    smoothed = np.stack([states.low_pass(rigid[:, :, j])[at] for j in range(rigid.shape[2])], axis=-1)
    sign = np.tanh(states.qd / options.sign_speed)
    terms = [sign, *(sign * np.abs(states.qd) ** d for d in options.exponents)]
    if options.offset:
        terms.append(np.ones_like(sign))
    rubbed = np.stack([states.low_pass(term)[at] for term in terms], axis=-1)
    n, f = rubbed.shape[1:]
    spread = np.zeros((len(at), n, n * f))
    for k in range(n):
        spread[:, k, k * f : (k + 1) * f] = rubbed[:, k]
    return np.concatenate([smoothed, spread], axis=2)


def _notes(logs: Sequence[Log]) -> tuple[str, ...]:
    return tuple(note for log in logs for note in log.notes)


def _warnings(chain: Chain, solved: Estimate, l: int) -> tuple[str, ...]:
    warnings = []
    unseen = np.flatnonzero(~solved.identifiable[:l])
    if len(unseen):
        names = ", ".join(f"theta_{k + 1}" for k in unseen)
        warnings.append(
            f"{names} unidentifiable from this log: rank {solved.rank} of {len(solved.identifiable)}"
        )
    return (*warnings, *noise_warnings("linear fit", chain.joint_names, solved))
