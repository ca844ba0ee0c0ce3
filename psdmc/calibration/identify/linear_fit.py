"""One linear fit of one log: base parameters, Coulomb and viscous friction, offsets.

The alternative to the four steps for a single exciting log with torques, or currents with known constants. Regressor
and friction columns pass through the same filter as the measurement.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.coupling import Matrix, coupling_of
from psdmc.calibration.identify.kept_rows import KeptRows
from psdmc.calibration.identify.least_squares import Estimate, FitOptions, Prior, estimate_rows
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.prior import base_parameter_scale, torque_sizes
from psdmc.calibration.identify.residuals import noise_warnings
from psdmc.calibration.logs.check_options import CheckOptions
from psdmc.calibration.logs.filter import SplitOptions, States, held_out_of, smoothed_rows, stretches
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.log_survey import STRETCH_ROWS
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.logs.row_store import HELD_BYTES
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.progress import Step
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class LinearOptions:
    """Options of the linear fit of one log.

    exponents   of the viscous terms |qd|^d sign(qd), each with a coefficient of its own; the first is `viscous`
    sign_speed  rad/s over which Coulomb friction changes sign: tanh(qd / sign_speed)
    offset      whether each joint's torque has a constant of its own
    stretch     rows of a log that are filtered at once
    coupling    C of q_joint = C q_motor where motors drive several joints: friction acts on the motors; empty: none
    held_bytes  of columns that are held in memory; more of them go to a temporary file
    """

    filter: FilterOptions = field(default_factory=lambda: FilterOptions(cutoff=8.0))
    split: SplitOptions = field(default_factory=lambda: SplitOptions(held_out=0.3, blocks=0))
    fit: FitOptions = field(default_factory=lambda: FitOptions(method="irls"))
    check: CheckOptions = field(default_factory=CheckOptions)
    exponents: tuple[float, ...] = (1.0,)
    sign_speed: float = 0.03
    offset: bool = True
    coupling: Matrix = ()
    stretch: int = STRETCH_ROWS
    held_bytes: int = HELD_BYTES


@dataclass(frozen=True, slots=True, eq=False)
class LinearResult:
    """One vector: theta_b, then each joint's friction and offset.

    estimate   of the whole vector, without constraints
    problem    the rows of the fit
    prior      the values in unseen directions
    motors     that made torques of what was logged
    """

    estimate: Estimate
    problem: LinearProblem
    prior: Prior
    motors: Motors
    warnings: tuple[str, ...]

    @property
    def theta_b(self) -> Array:
        return self.estimate.values[: self.problem.l]

    @property
    def std(self) -> Array:
        return self.estimate.std[: self.problem.l]

    @property
    def identifiable(self) -> NDArray[np.bool_]:
        return self.estimate.identifiable[: self.problem.l]

    @property
    def friction(self) -> Array:
        """(n, f) in the order of problem.friction."""
        return self.estimate.values[self.problem.l :].reshape(len(self.problem.chain), -1)


@dataclass(frozen=True, slots=True, eq=False)
class LinearProblem:
    """The stacked rows of independent samples.

    rows      of the l + n f unknowns, N samples, with what the position sensors' noise alone would make of them
    torque    (N, n)  N m;  held_out (N,)
    names     l + n f  of the unknowns, for messages
    """

    chain: Mechanism
    rows: KeptRows
    torque: Array
    held_out: NDArray[np.bool_]
    l: int
    friction: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        own = tuple(f"{name} of {joint}" for joint in self.chain.joint_names for name in self.friction)
        return (*(f"theta_{k + 1}" for k in range(self.l)), *own)

    @property
    def never_negative(self) -> NDArray[np.bool_]:
        """(l + n f,) true for friction other than offsets, which only takes energy and may not be negative."""
        own = np.array([name != "offset" for name in self.friction] * len(self.chain), dtype=bool)
        return np.concatenate([np.zeros(self.l, dtype=bool), own])


def calibrate_linear(
    chain: Mechanism,
    model: Regressor,
    l: int,
    logs: Sequence[AnyLog],
    options: LinearOptions | None = None,
    motors: Motors | None = None,
    theta_b: Array | None = None,
    progress: Callable[[str], None] = lambda step: None,
) -> LinearResult:
    """Base parameters and simple friction by linear least squares; InputError where a log cannot be used.

    theta_b   (l,)  the file's values, kept in directions that the logs do not show; None: zero
    progress  is told how much of the logs has been read
    """
    options = options or LinearOptions()
    motors = motors or Motors.torques(len(chain))
    checked_logs = [checked(log, chain, options.filter.cutoff, options.check) for log in logs]
    problem, resting = linear_problem(chain, model, l, checked_logs, options, motors, progress)
    progress("linear fit: solving")
    kept = np.repeat(~problem.held_out[:, None], len(chain), axis=1)
    prior = _prior(chain, model, problem, options, theta_b)
    solved = estimate_rows(problem.rows, problem.torque, options.fit, None, kept, prior)
    notes = tuple(note for log in checked_logs for note in log.notes)
    warnings = (*notes, *resting, *noise_warnings("linear fit", chain.joint_names, solved))
    return LinearResult(solved, problem, prior, motors, warnings)


def _prior(
    chain: Mechanism, model: Regressor, problem: LinearProblem, options: LinearOptions, theta_b: Array | None
) -> Prior:
    """The file's theta_b and no friction; friction may be as large as its joint's torque at an ordinary speed."""
    sizes = torque_sizes(problem.torque[~problem.held_out])
    rigid = base_parameter_scale(chain, model, sizes, theta_b)
    own = np.repeat(sizes, len(problem.friction))
    values = np.concatenate([np.zeros(problem.l) if theta_b is None else theta_b, np.zeros(len(own))])
    return Prior(values, np.concatenate([rigid, own]))


def friction_names(exponents: Sequence[float], offset: bool) -> tuple[str, ...]:
    """Names of a joint's friction columns, in order."""
    viscous = tuple("viscous" if k == 0 else f"viscous^{d:g}" for k, d in enumerate(exponents))
    return ("coulomb", *viscous, *(("offset",) if offset else ()))


def friction_terms(qd: Array, sign_speed: float, exponents: Sequence[float], offset: bool) -> list[Array]:
    """(N, n) each: the factors of the coefficients of Coulomb friction, the viscous terms and the offset, before the
    filter."""
    sign = np.tanh(qd / sign_speed)
    terms = [sign, *(sign * np.abs(qd) ** d for d in exponents)]
    return [*terms, np.ones_like(sign)] if offset else terms


def linear_problem(
    chain: Mechanism,
    model: Regressor,
    l: int,
    logs: Sequence[AnyLog],
    options: LinearOptions,
    motors: Motors,
    progress: Callable[[str], None],
) -> tuple[LinearProblem, tuple[str, ...]]:
    """The stacked independent samples of all logs, each log split separately; and remarks on joints that rest."""
    names = friction_names(options.exponents, options.offset)
    rows = KeptRows(len(chain), l + len(chain) * len(names), options.held_bytes)
    torques, outs, remarks = [], [], []
    for log in logs:
        count = 0
        for stretch in stretches(log, options.filter, options.check, options.stretch):
            states, at = stretch.states, stretch.at
            rows.append(*_columns(model, states, at, options))
            torques.append(motors.torque(states.effort)[at])
            if not count:
                remarks += _ripples(log, states, options)
            count += len(at)
            share = (states.first + at[-1]) / len(log)
            progress(Step(f"linear fit: {log.name}: {share:.0%}", share))
        outs.append(held_out_of(log, count, options.split))
    problem = LinearProblem(chain, rows, np.concatenate(torques), np.concatenate(outs), l, names)
    return problem, tuple(remarks)


def _ripples(log: AnyLog, states: States, options: LinearOptions) -> list[str]:
    """Remarks on joints that move by no more than noise, where the log's own check did not find them at rest."""
    found = [
        f"{name} ({size:.1e} rad)" if name not in (log.sliding or ()) else f"{name} ({size:.1e} m)"
        for name, size, rests in zip(log.joint_names, states.motion, states.still, strict=True)
        if rests and size >= options.check.smallest_motion
    ]
    if not found:
        return []
    return [f"{log.name}: joint(s) {', '.join(found)} ripple by no more than sensor noise: taken as resting"]


def _columns(
    model: Regressor, states: States, at: NDArray[np.intp], options: LinearOptions
) -> tuple[Array, Array]:
    """(rows, n, l + n f) columns, filtered like the torque; and the change of them by another draw of the position
    noise."""
    measured = (states.q, states.qd, states.qdd)
    jittered = states.jittered()
    plain = _filtered_columns(model, states, measured, at, options)
    if not states.noise.any():
        return plain, np.zeros_like(plain)
    return plain, _filtered_columns(model, states, jittered, at, options) - plain


def _filtered_columns(
    model: Regressor,
    states: States,
    motion: tuple[Array, Array, Array],
    at: NDArray[np.intp],
    options: LinearOptions,
) -> Array:
    smoothed = smoothed_rows(states, at, lambda rows: model.regressor(*(part[rows] for part in motion)))
    coupling = coupling_of(options.coupling)
    speed = motion[1] if coupling is None else coupling.to_motors(motion[1])
    terms = friction_terms(speed, options.sign_speed, options.exponents, options.offset)
    rubbed = np.stack([states.low_pass(term)[at] for term in terms], axis=-1)
    n, f = rubbed.shape[1:]
    onto_joints = np.eye(n) if coupling is None else coupling.inverse
    spread = np.einsum("tkf,kj->tjkf", rubbed, onto_joints).reshape(len(at), n, n * f)
    return np.concatenate([smoothed, spread], axis=2)
