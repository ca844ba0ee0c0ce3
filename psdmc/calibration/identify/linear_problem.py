"""The linear least-squares problem of a fit of plain logs: its options (filter, split, friction terms, tables of a log
description) and its rows. Columns of all unknowns are filtered as the torques are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.columns.columns import Columns, read_columns
from psdmc.calibration.columns.effect import Motion, poses
from psdmc.calibration.identify.estimate import NO_EFFECT, ORDINARY_SPEED, SEED, FitOptions
from psdmc.calibration.identify.least_squares import KeptRows
from psdmc.calibration.identify.motor_model import Coupling, Motors, coupling_of
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.filter import SplitOptions, States, held_out_of, stretches
from psdmc.calibration.logs.log import HELD_BYTES, AnyLog, Array
from psdmc.calibration.logs.log_checks import CheckOptions
from psdmc.calibration.logs.log_survey import STRETCH_ROWS
from psdmc.calibration.logs.low_pass import FilterOptions
from psdmc.calibration.logs.parts import each_part
from psdmc.calibration.logs.smoothed_rows import smoothed_rows
from psdmc.friction.law import At, Term
from psdmc.friction.terms import every_joint_s
from psdmc.model.calibrated import Matrix
from psdmc.progress import Step
from psdmc.robot.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class ElasticityOptions:
    """The statements of a log description about elastic joints.

    asked          whether the description asks for joint stiffnesses; then a log without two encoders is refused
    joints         joints whose stiffness is asked for; empty: all joints with two encoders
    drive_inertia  known drive inertias at the joint, kg m^2 (kg), by joint; the others are fitted with the stiffness
    """

    asked: bool = False
    joints: tuple[str, ...] = ()
    drive_inertia: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LinearOptions:
    """Options of the linear fit of plain logs.

    filter      low-pass filter of the logs
    split       share of each log that is held out for validation
    exponents   exponents d of the viscous terms |qd|^d sign(qd), each with its own coefficient
    sign_speed  rad/s over which Coulomb friction changes sign: tanh(qd / sign_speed)
    offset      whether each joint has a constant torque
    coupling    matrix C of q_joint = C q_motor if several motors drive a joint; friction then acts on the motors.
                Empty: none
    stretch     number of rows of a log that are filtered at once
    held_bytes  largest number of bytes of columns in memory; more of them go to a temporary file
    tables      springs and friction of a log description, as TOML gives them (docs/how-to/springs-and-friction.md,
                priors.md)
    tables_from  name of the file with these tables, for messages
    columns     springs and further friction of a robot, made from these tables; each value is one more unknown
    elasticity  what is asked for and known of elastic joints
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
    elasticity: ElasticityOptions = field(default_factory=ElasticityOptions)

    @property
    def terms(self) -> tuple[Term, ...]:
        """Friction terms of every joint."""
        return every_joint_s(self.exponents, self.offset)

    def for_robot(self, chain: Mechanism) -> LinearOptions:
        """Return the options with one robot's springs and friction, from `tables`. Raises InputError if they are wrong."""
        folder = Path(self.tables_from).parent
        columns = read_columns(self.tables, chain, self.tables_from, self.offset, folder)
        return replace(self, columns=columns, offset=self.offset and columns.plain_offsets)


@dataclass(frozen=True, slots=True, eq=False)
class LinearProblem:
    """The rows of the linear least-squares problem at N samples that count as independent. The unknowns are l base
    parameters, f values of plain friction of each of n joints, and m values of springs and further friction.

    rows      N samples of the columns of the l + n f + m unknowns, and of the columns that the position sensors' noise
              alone would give
    torque    (N, n) measured torques, N m
    held_out  (N,) whether a sample is held out for validation
    terms     plain friction terms of every joint, which have f values together
    columns   springs and further friction
    counts    number of samples of each log, in their order
    time      (N,) s, of the samples
    """

    chain: Mechanism
    rows: KeptRows
    torque: Array
    held_out: NDArray[np.bool_]
    l: int
    terms: tuple[Term, ...]
    columns: Columns = field(default_factory=Columns)
    counts: tuple[int, ...] = ()
    time: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names, for messages, of the unknowns after the l base parameters. They are f values of plain
        friction for each of n joints, then m values of springs and further friction."""
        return (*(f"{name} of {joint}" for joint, name in self.plain), *self.columns.names)

    @property
    def friction(self) -> tuple[str, ...]:
        """Return the names of the f friction values that every joint has, in order."""
        return names_of(self.terms)

    @property
    def plain(self) -> tuple[tuple[str, str], ...]:
        """Return the joint and the name of each value of plain friction, joint by joint."""
        return tuple((joint, name) for joint in self.chain.v_names for name in self.friction)

    @property
    def owners(self) -> tuple[tuple[str, str], ...]:
        """Return the owner and the name of each value after the l base parameters, in the order of `names`."""
        return (*self.plain, *((unknown.owner, unknown.name) for unknown in self.columns.unknowns))

    @property
    def first_extra(self) -> int:
        return self.l + self.chain.nv * len(self.friction)

    @property
    def never_negative(self) -> NDArray[np.bool_]:
        """Return, for each unknown, whether it may not be negative. Friction coefficients may not, because friction
        only dissipates energy. The order is base parameters, plain friction, springs and further friction."""
        own = [value.low >= 0.0 for term in self.terms for value in term.law.values] * self.chain.nv
        return np.concatenate([np.zeros(self.l, dtype=bool), np.array(own), self.columns.never_negative])

    @property
    def limits(self) -> Array:
        """Return k rows of linear inequalities between the unknowns, an array (k, l + n f + m). The product of each row
        with the vector of unknowns may not be negative. The rows keep the magnitude of a value below another value of
        its joint."""
        rows: list[Array] = []
        width = self.first_extra + len(self.columns)
        for k, unknown in enumerate(self.columns.unknowns, start=self.first_extra):
            if not unknown.within:
                continue
            for sign in (1.0, -1.0):
                row = np.zeros(width)
                row[self.l + self.plain.index((unknown.owner, unknown.within))], row[k] = 1.0, sign
                rows.append(row)
        return np.reshape(rows, (-1, width))


def names_of(terms: Sequence[Term]) -> tuple[str, ...]:
    """Return the names of all values of the friction terms, such as the Coulomb and the viscous coefficient."""
    return tuple(name for term in terms for name in term.names)


def friction_columns(terms: Sequence[Term], qd: Array, sign_speed: float) -> list[Array]:
    """Return one array (N samples, n joints) for each friction value: the friction torque per unit of the value, before
    any filter.

    qd          (N, n) joint speeds
    sign_speed  rad/s over which Coulomb friction changes sign
    """
    at = At(v=qd, sign=np.tanh(qd / sign_speed))
    return [np.broadcast_to(column, qd.shape) for term in terms for column in term.columns(at)]


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
    """Return the rows of the linear least-squares problem at the samples of all logs that count as independent. Also
    returns remarks on logs of joints at rest. Each log is split for validation separately.

    carried  (l,) base parameters from which the torque on the joints is computed, if friction depends on this torque
    """
    terms = options.terms
    width = l + chain.nv * len(names_of(terms)) + len(options.columns)
    rows = KeptRows(chain.nv, width, options.held_bytes)
    torques, outs, remarks, times = [], [], [], []
    for log in logs:
        count = 0
        parts = stretches(log, options.filter, options.check, options.stretch)
        for stretch, columns in each_part(
            parts, lambda part: _columns(model, part.states, part.at, options, carried)
        ):
            states, at = stretch.states, stretch.at
            rows.append(*columns)
            torques.append(motors.torque(states.effort)[at])
            times.append(states.time[at])
            if not count:
                remarks += _ripples(log, states, options)
            count += len(at)
            share = (states.first + at[-1]) / len(log)
            progress(Step(f"linear fit: {log.name}: {share:.0%}", share))
        outs.append(held_out_of(log, count, options.split))
    counts = tuple(len(out) for out in outs)
    problem = LinearProblem(
        chain,
        rows,
        np.concatenate(torques),
        np.concatenate(outs),
        l,
        terms,
        options.columns,
        counts,
        np.concatenate(times),
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
    """(rows, n, l + n f + m) columns, filtered like the torque, and their change by another draw of noise."""
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
        """Return the torque columns of bodies, springs and further friction as one array, at some rows of the log."""
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

    def own(rows: slice) -> Array:
        return np.stack(friction_columns(options.terms, speed[rows], options.sign_speed), axis=-1)

    rubbed = smoothed_rows(states, at, own)
    n, f = rubbed.shape[1:]
    onto_joints = np.eye(n) if coupling is None else coupling.inverse
    spread = np.einsum("tkf,kj->tjkf", rubbed, onto_joints).reshape(len(at), n, n * f)
    return np.concatenate([rigid, spread, extra], axis=2)


# Springs and further friction


def motion_of(
    q: Array, qd: Array, sign_speed: float, load: Array | None = None, coupling: Coupling | None = None
) -> Motion:
    """Return the motion of the joints, together with the motion of the parts that have friction. The torques of springs
    and friction are computed from both. If several motors drive a joint, the parts that have friction are the motors.
    Otherwise they are the joints.

    q, qd     (N samples, n joints) positions and speeds of the joints
    load      (N, n) joint torques of the rigid bodies, for friction that grows with the torque; None if no friction does
    coupling  how joint positions depend on motor positions; None: each motor drives one joint
    """
    if coupling is None:
        return Motion(q, qd, q, qd, sign_speed, load)
    of_motors = None if load is None else coupling.torque_of_motors(load)
    place, speed = coupling.to_motors(q), coupling.to_motors(qd)
    return Motion(q, qd, place, speed, sign_speed, of_motors, coupling.inverse)


def extra_scale(chain: Mechanism, columns: Columns, sign_speed: float, sizes: Array) -> Array:
    """Return a plausible size (m,) of each of the m unknown values of springs and friction. With this size, the largest
    torque of the value at some joint equals the whole torque of that joint.

    sizes  (n,) N m, typical torques of the n joints
    """
    if not len(columns):
        return np.zeros(0)
    q = poses(chain)
    speeds = np.geomspace(1e-3, 1.0, len(q))[:, None] * ORDINARY_SPEED
    qd = speeds * np.random.default_rng(SEED).choice([-1.0, 1.0], q.shape)
    load = np.broadcast_to(sizes, q.shape)
    effect = np.abs(columns.values(motion_of(q, qd, sign_speed, load))).max(axis=0)
    acts = effect > NO_EFFECT * effect.max(axis=0, initial=0.0)
    scale = np.min(np.where(acts, sizes[:, None] / np.where(acts, effect, 1.0), np.inf), axis=0)
    return np.where(np.isfinite(scale), scale, 1.0)
