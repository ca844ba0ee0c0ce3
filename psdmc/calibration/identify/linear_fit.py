"""One linear fit of one log: base parameters, Coulomb and viscous friction, offsets.

The alternative to the four steps for a single exciting log with torques, or currents with known constants. Regressor
and friction columns pass through the same filter as the measurement.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.columns.columns import Columns, read_columns
from psdmc.calibration.identify.coupling import Matrix, coupling_of
from psdmc.calibration.identify.extra import extra_scale, limits_of, motion_of
from psdmc.calibration.identify.kept_rows import KeptRows
from psdmc.calibration.identify.least_squares import Estimate, FitOptions, Prior, estimate_rows
from psdmc.calibration.identify.motor_model import Motors, RowsByMotors
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
    tables      of a log description, as TOML gives them: springs, friction (docs/how-to/springs-and-friction.md, priors.md)
    tables_from  the file that they are of, for messages
    columns     made of these for a robot: springs and further friction, each value of which is one more unknown
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
    tables: Mapping[str, Any] = field(default_factory=dict)
    tables_from: str = "description"
    columns: Columns = field(default_factory=Columns)

    def for_robot(self, chain: Mechanism) -> LinearOptions:
        """These with the columns that the tables mean; InputError names what is wrong in them."""
        columns = read_columns(self.tables, chain, self.tables_from, self.offset)
        return replace(self, columns=columns, offset=self.offset and columns.plain_offsets)


@dataclass(frozen=True, slots=True, eq=False)
class LinearResult:
    """One vector: theta_b, then each joint's friction and offset, then the values of the extra columns.

    estimate   of the whole vector, without constraints
    problem    the rows of the fit
    prior      the values in unseen directions
    motors     that made torques of what was logged
    dropped    (l + n f + m,)  entries that are left at the prior, as the data do not need them; None: none
    stated     whether a prior of theta_b was joined with the data
    """

    estimate: Estimate
    problem: LinearProblem
    prior: Prior
    motors: Motors
    warnings: tuple[str, ...]
    dropped: NDArray[np.bool_] | None = None
    stated: bool = False

    @property
    def samples(self) -> int:
        """Independent samples that were fitted, all joints together."""
        return int((~self.problem.held_out).sum()) * len(self.problem.chain)

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
        start, n = self.problem.l, len(self.problem.chain)
        return self.estimate.values[start : self.problem.first_extra].reshape(n, -1)

    @property
    def extra(self) -> Array:
        """(m,) in the order of problem.columns.unknowns."""
        return self.estimate.values[self.problem.first_extra :]


@dataclass(frozen=True, slots=True, eq=False)
class LinearProblem:
    """The stacked rows of independent samples.

    rows      of the l + n f + m unknowns, N samples, with what the position sensors' noise alone would make of them
    torque    (N, n)  N m;  held_out (N,)
    names     l + n f + m  of the unknowns, for messages
    columns   whose m values come last
    """

    chain: Mechanism
    rows: KeptRows
    torque: Array
    held_out: NDArray[np.bool_]
    l: int
    friction: tuple[str, ...]
    columns: Columns = field(default_factory=Columns)

    @property
    def names(self) -> tuple[str, ...]:
        own = tuple(f"{name} of {joint}" for joint, name in self.plain)
        return (*(f"theta_{k + 1}" for k in range(self.l)), *own, *self.columns.names)

    @property
    def plain(self) -> tuple[tuple[str, str], ...]:
        """n f joints and names of plain friction, in order."""
        return tuple((joint, name) for joint in self.chain.joint_names for name in self.friction)

    @property
    def first_extra(self) -> int:
        return self.l + len(self.chain) * len(self.friction)

    @property
    def never_negative(self) -> NDArray[np.bool_]:
        """(l + n f + m,) true for friction other than offsets, which only takes energy and may not be negative, and for
        extra columns that say so."""
        own = np.array([name != "offset" for _, name in self.plain], dtype=bool)
        return np.concatenate([np.zeros(self.l, dtype=bool), own, self.columns.never_negative])

    @property
    def limits(self) -> Array:
        """(k, l + n f + m) whose products with the vector may not be negative either."""
        return limits_of(self.columns, self.plain, self.l)


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
    whole = options.columns
    first = whole if theta_b is not None else whole.without_load()
    found = _fitted(
        chain, model, l, checked_logs, replace(options, columns=first), motors, theta_b, theta_b, progress
    )
    for _ in range(LOAD_ROUNDS if whole.by_load else 0):
        found = _fitted(chain, model, l, checked_logs, options, motors, theta_b, found.theta_b, progress)
    return found


LOAD_ROUNDS = 2
"""Fits after the first where friction depends on the load: each takes the load of the one before, whose error it inherits
times the coefficient of friction, some hundredths."""


def _fitted(
    chain: Mechanism,
    model: Regressor,
    l: int,
    logs: Sequence[AnyLog],
    options: LinearOptions,
    motors: Motors,
    theta_b: Array | None,
    carried: Array | None,
    progress: Callable[[str], None],
) -> LinearResult:
    """One fit; `carried` (l,) are the base parameters of the load that friction depends on."""
    problem, resting = linear_problem(chain, model, l, logs, options, motors, progress, carried)
    progress("linear fit: solving")
    kept = np.repeat(~problem.held_out[:, None], len(chain), axis=1)
    prior = linear_prior(chain, model, problem, options, theta_b)
    uncertain = motors.relative_covariance
    rows = problem.rows if uncertain is None else RowsByMotors(problem.rows, problem.torque)
    solved = estimate_rows(rows, problem.torque, options.fit, uncertain, kept, prior)
    notes = tuple(note for log in logs for note in log.notes)
    warnings = (*notes, *resting, *noise_warnings("linear fit", chain.joint_names, solved))
    return LinearResult(solved, problem, prior, motors, warnings)


def linear_prior(
    chain: Mechanism, model: Regressor, problem: LinearProblem, options: LinearOptions, theta_b: Array | None
) -> Prior:
    """The file's theta_b, no friction and no springs; friction may be as large as its joint's torque at an ordinary
    speed."""
    sizes = torque_sizes(problem.torque[~problem.held_out])
    rigid = base_parameter_scale(chain, model, sizes, theta_b)
    own = np.repeat(sizes, len(problem.friction))
    extra = extra_scale(chain, options.columns, options.sign_speed, sizes)
    beside = np.zeros(len(own) + len(extra))
    values = np.concatenate([np.zeros(problem.l) if theta_b is None else theta_b, beside])
    return Prior(values, np.concatenate([rigid, own, extra]))


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
    carried: Array | None = None,
) -> tuple[LinearProblem, tuple[str, ...]]:
    """The stacked independent samples of all logs, each log split separately; and remarks on joints that rest.

    carried  (l,)  base parameters of the load that friction depends on, where a column asks for it
    """
    names = friction_names(options.exponents, options.offset)
    width = l + len(chain) * len(names) + len(options.columns)
    rows = KeptRows(len(chain), width, options.held_bytes)
    torques, outs, remarks = [], [], []
    for log in logs:
        count = 0
        for stretch in stretches(log, options.filter, options.check, options.stretch):
            states, at = stretch.states, stretch.at
            rows.append(*_columns(model, states, at, options, carried))
            torques.append(motors.torque(states.effort)[at])
            if not count:
                remarks += _ripples(log, states, options)
            count += len(at)
            share = (states.first + at[-1]) / len(log)
            progress(Step(f"linear fit: {log.name}: {share:.0%}", share))
        outs.append(held_out_of(log, count, options.split))
    problem = LinearProblem(
        chain, rows, np.concatenate(torques), np.concatenate(outs), l, names, options.columns
    )
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
    model: Regressor, states: States, at: NDArray[np.intp], options: LinearOptions, carried: Array | None
) -> tuple[Array, Array]:
    """(rows, n, l + n f + m) columns, filtered like the torque; and the change of them by another draw of the position
    noise."""
    measured = (states.q, states.qd, states.qdd)
    jittered = states.jittered()
    plain = _filtered_columns(model, states, measured, at, options, carried)
    if not states.noise.any():
        return plain, np.zeros_like(plain)
    return plain, _filtered_columns(model, states, jittered, at, options, carried) - plain


def _filtered_columns(
    model: Regressor,
    states: States,
    motion: tuple[Array, Array, Array],
    at: NDArray[np.intp],
    options: LinearOptions,
    carried: Array | None,
) -> Array:
    def whole(rows: slice) -> Array:
        """Rigid columns and extra ones."""
        q, qd, qdd = (part[rows] for part in motion)
        rigid = model.regressor(q, qd, qdd)
        if not len(options.columns):
            return rigid
        load = None if carried is None else rigid @ carried
        extra = options.columns.values(motion_of(q, qd, options.sign_speed, load, coupling))
        return np.concatenate([rigid, extra], axis=2)

    coupling = coupling_of(options.coupling)
    smoothed = smoothed_rows(states, at, whole)
    rigid, extra = np.split(smoothed, [smoothed.shape[2] - len(options.columns)], axis=2)
    speed = motion[1] if coupling is None else coupling.to_motors(motion[1])
    terms = friction_terms(speed, options.sign_speed, options.exponents, options.offset)
    rubbed = np.stack([states.low_pass(term)[at] for term in terms], axis=-1)
    n, f = rubbed.shape[1:]
    onto_joints = np.eye(n) if coupling is None else coupling.inverse
    spread = np.einsum("tkf,kj->tjkf", rubbed, onto_joints).reshape(len(at), n, n * f)
    return np.concatenate([rigid, spread, extra], axis=2)
