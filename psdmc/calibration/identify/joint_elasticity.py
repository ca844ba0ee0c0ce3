"""Identifies the stiffness and damping between the motor and the link of joints with an encoder on each side.

The motor's equation (Spong 1987) is linear in the unknowns of its joint:

    motor torque = stiffness (theta - q) + damping (thetad - qd) + drive inertia thetadd + friction(thetad) + offset

theta is the motor's position divided by the gear ratio, q the link's. All are measured, so that the masses of the links
do not enter. A torque sensor behind the gear measures the first two terms and an offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from psdmc.calibration.identify.estimate import Consider, Estimate, Prior
from psdmc.calibration.identify.friction import FrictionResult
from psdmc.calibration.identify.inertial import friction_slopes
from psdmc.calibration.identify.least_squares import estimate
from psdmc.calibration.identify.linear_problem import LinearOptions, friction_columns, motion_of
from psdmc.calibration.identify.motor_model import Motors
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.identify.state_friction import friction_torque
from psdmc.calibration.logs.filter import (
    States,
    Stretch,
    central_differences,
    held_out_of,
    stretches,
)
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import AnyLog, Array
from psdmc.calibration.logs.log_checks import checked
from psdmc.calibration.logs.log_survey import STRETCH_ROWS
from psdmc.calibration.logs.low_pass import noise_like
from psdmc.calibration.logs.smoothed_rows import smoothed_rows
from psdmc.errors import InputError
from psdmc.friction.law import unit_of
from psdmc.model.calibrated import IDENTIFIED, WEAK, NumberRow, Remark
from psdmc.robot.mechanism import Joint, Mechanism

STIFFNESS, DAMPING, INERTIA = "joint_stiffness", "joint_damping", "drive_inertia"
UNITS = {STIFFNESS: "Nm/rad", DAMPING: "Nms/rad", INERTIA: "kg m^2"}
"""Of the results, for a joint that turns."""
UNSEEN = Remark("not determined", "unseen")
LARGEST_DIFFERENCE = 0.1
"""Share by which a motor's motion may differ from its link's: far more than any joint bends."""
CONSTANT_SHARE = 1e-6
"""Of a column's largest entry: a smaller range is that of a constant after the filter."""
IDENTIFIED_SHARE = 0.5
"""Of a value: the largest standard deviation of an identified number."""


def elastic_joints(logs: Sequence[AnyLog], options: LinearOptions) -> NDArray[np.bool_]:
    """Return for each joint (n,) whether all logs have the positions of its motor and of its link.

    Raises InputError if the log description asks for the stiffness of a joint with one encoder, or if a motor does not
    move as its link does.
    """
    both = np.all([_with_two_encoders(log) for log in logs], axis=0)
    wanted = options.elasticity
    names = logs[0].joint_names
    lacking = [name for name in wanted.joints or names if not both[names.index(name)]]
    if wanted.asked and lacking and (wanted.joints or not both.any()):
        one = next((log.name for log in logs if not _with_two_encoders(log).all()), logs[0].name)
        raise InputError(
            f"{options.tables_from}: [elasticity] asks for the stiffness of joint(s) {listed(lacking)}: {one} has one "
            "position of each, expected two",
            "name the motor's encoder as motor_position, and the link's as position; or leave out [elasticity]",
        )
    if wanted.joints:
        both &= np.array([name in wanted.joints for name in names])
    return np.asarray(both)


def _with_two_encoders(log: AnyLog) -> NDArray[np.bool_]:
    """Whether motor and link of each joint (n,) were measured; InputError where they move differently."""
    part = log.rows(0, STRETCH_ROWS)
    if part.motor_position is None:
        return np.zeros(len(log.joint_names), dtype=bool)
    q, theta = (values - values.mean(axis=0) for values in (part.position, part.motor_position))
    both = np.any(part.motor_position != part.position, axis=0)
    power = np.sum(q**2, axis=0)
    ratio = np.divide(np.sum(q * theta, axis=0), power, out=np.ones_like(power), where=power > 0)
    for k in np.flatnonzero(both & (np.abs(ratio - 1.0) > LARGEST_DIFFERENCE)):
        raise InputError(
            f"{log.name}: joint {log.joint_names[k]}: motor_position moves {ratio[k]:.4g} times as far as position, "
            "expected 1",
            "divide it by the gear ratio: gear_ratio and sign of motor_position in a log description",
        )
    return np.asarray(both)


@dataclass(frozen=True, slots=True, eq=False)
class Elasticity:
    """The identified values of elastic joints with standard deviations, and remarks for the user."""

    rows: tuple[NumberRow, ...] = ()
    notes: tuple[str, ...] = ()


def joint_elasticity(
    chain: Mechanism,
    model: Regressor,
    logs: Sequence[AnyLog],
    options: LinearOptions,
    motors: Motors,
    theta_b: Array,
    known: FrictionResult | None = None,
) -> Elasticity:
    """Return stiffness, damping and drive inertia of each joint with two encoders, from the rows that a fit uses.

    theta_b  (l,) base parameters, from which loads of joints follow, for friction that depends on them
    known    delay and friction that a campaign's friction runs gave; the fit then finds only what they left
    """
    kept = [log.ordered(chain.v_names) for log in logs if log.use == "fit"]
    both = elastic_joints(kept, options)
    if not both.any():
        return Elasticity()
    kept = [checked(log, chain, options.filter.cutoff, options.check) for log in kept]
    moving, parts, efforts = both.copy(), [], _Efforts(motors, chain.v_names, known)
    for log in kept:
        of_motors = log.of_motors
        assert of_motors is not None
        own = []
        steps = [stretches(each, options.filter, options.check, options.stretch) for each in (log, of_motors)]
        for link, motor in zip(*steps, strict=True):
            moving &= ~link.states.still & ~motor.states.still
            own.append(_samples(model, link, motor, options, efforts, theta_b))
        samples = _Samples.of(own)
        parts.append(samples.at(~held_out_of(log, len(samples.torque), options.split)))
    behind_gear = kept[0].quantity == "joint_torque"
    whole = _Samples.of(parts)
    rows: list[NumberRow] = []
    for k in np.flatnonzero(moving):
        joint = chain.leading_joints[k]
        covariance = None if known is None else known.covariance_with_delay(joint.name)
        inertia = options.elasticity.drive_inertia.get(joint.name)
        found = _fitted(whole, int(k), behind_gear, options, inertia, covariance)
        rows += _rows(joint, *found, float(motors.relative_std[k]))
    return Elasticity(tuple(rows), _notes(chain, both & ~moving, rows))


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """N independent samples of n joints: deflection, its rate, the motor's acceleration, and friction's columns.

    columns   (N, n, 3) the first three
    noise     (N, n, 3) what the encoders' noise alone would give
    friction  (N, n, f) torques per unit of each friction value
    torque    (N, n) of the motors
    known     (N, n, c) change of (prediction - torque) per unit of each of c earlier results: friction values and delay
    """

    columns: Array
    noise: Array
    friction: Array
    torque: Array
    known: Array

    @staticmethod
    def of(parts: Sequence[_Samples]) -> _Samples:
        names = ("columns", "noise", "friction", "torque", "known")
        return _Samples(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def at(self, rows: NDArray[np.bool_]) -> _Samples:
        parts = (self.columns, self.noise, self.friction, self.torque, self.known)
        return _Samples(*(part[rows] for part in parts))


@dataclass(frozen=True, slots=True, eq=False)
class _Efforts:
    """The data that turn a log's efforts into torques: motors, and what friction runs of the named joints gave."""

    motors: Motors
    names: tuple[str, ...]
    known: FrictionResult | None

    def torque(self, states: States, speed: Array, at: NDArray[np.intp]) -> Array:
        """Torques at some rows, without known delay and friction at the motors' speeds (N, n)."""
        torque = self.motors.torque(states.effort)
        if self.known is None:
            return torque[at]
        found = np.asarray(CubicSpline(states.time, torque)(states.time[at] - self.known.delay))
        for k, name in enumerate(self.names):
            if name in self.known.joints:
                rubbed = friction_torque(self.known.joints[name].friction, speed[:, k], states.period)
                found[:, k] -= states.low_pass(rubbed)[at]
        return found

    def slopes(self, states: States, speed: Array, at: NDArray[np.intp]) -> Array:
        """(rows, n, 8) change of (prediction - torque) per unit of each joint's seven friction values and of the delay;
        (rows, n, 0) if these are not known."""
        if self.known is None:
            return np.zeros((len(at), len(self.names), 0))
        found = np.zeros((len(at), len(self.names), 8))
        measured = CubicSpline(states.time, self.motors.torque(states.effort))
        found[:, :, 7] = measured(states.time[at] - self.known.delay, 1)
        for k, name in enumerate(self.names):
            if name in self.known.joints:
                own = friction_slopes(self.known.joints[name], speed[:, k], states.period)
                found[:, k, :7] = np.stack([states.low_pass(slope)[at] for slope in own], axis=-1)
        return found


def _samples(
    model: Regressor,
    link: Stretch,
    motor: Stretch,
    options: LinearOptions,
    efforts: _Efforts,
    theta_b: Array,
) -> _Samples:
    """The samples of a part of a log. What is linear in the positions is filtered once, as the torque is."""
    here, there, at = link.states, motor.states, link.at
    shape = np.hypot(here.noise, there.noise)
    draw = here.low_pass(noise_like(shape, here.first, here.first + len(here.time)))
    rate, acceleration = central_differences(draw, here.period)
    share = np.divide(there.noise, shape, out=np.zeros_like(shape), where=shape > 0)
    columns = np.stack([there.q - here.q, there.qd - here.qd, there.qdd], axis=-1)
    noise = np.stack([draw, rate, acceleration * share], axis=-1)

    def further(rows: slice) -> Array:
        states = (here.q[rows], here.qd[rows], here.qdd[rows])
        load = model.regressor(*states) @ theta_b if options.columns.by_load else None
        found = options.columns.values(motion_of(there.q[rows], there.qd[rows], options.sign_speed, load))
        return np.asarray(found[:, :, ~options.columns.of_springs])

    own = friction_columns(options.terms, there.qd, options.sign_speed)
    friction = np.stack([here.low_pass(column)[at] for column in own], axis=-1) if own else None
    if len(options.columns):
        more = smoothed_rows(here, at, further)
        friction = more if friction is None else np.concatenate([friction, more], axis=2)
    if friction is None:
        friction = np.zeros((len(at), len(shape), 0))
    return _Samples(
        columns[at],
        noise[at],
        friction,
        efforts.torque(here, there.qd, at),
        efforts.slopes(here, there.qd, at),
    )


def _fitted(
    samples: _Samples,
    k: int,
    behind_gear: bool,
    options: LinearOptions,
    inertia: float | None,
    known: Array | None,
) -> tuple[tuple[str, ...], Array, Array, NDArray[np.bool_]]:
    """Names, values, standard deviations and whether each is determined, for the unknowns that are reported.

    behind_gear  whether sensors behind the gear measured the torques
    known        covariance of earlier results; None: there are none
    """
    columns, noise = samples.columns[:, k], samples.noise[:, k]
    columns = columns - columns.mean(axis=0) * [1.0, 0.0, 0.0]  # encoders have their own zeros
    torque = samples.torque[:, k]
    names: tuple[str, ...] = (STIFFNESS, DAMPING, INERTIA)
    friction = samples.friction[:, k]
    if behind_gear:
        names, friction = names[:2], friction[:, :0]
    elif inertia is not None:
        torque, names = torque - inertia * columns[:, 2], names[:2]
    constant = np.ones((len(torque), 1))
    changes = np.ptp(friction, axis=0) > CONSTANT_SHARE * np.abs(friction).max(axis=0)
    others = friction[:, changes]
    whole = np.concatenate([columns[:, : len(names)], others, constant], axis=1)
    wrong = np.zeros_like(whole)
    wrong[:, : len(names)] = noise[:, : len(names)]
    size = np.sqrt(np.mean(torque**2)) or 1.0
    scale = size / np.maximum(np.sqrt(np.mean(whole**2, axis=0)), 1e-300)
    prior = Prior(np.zeros(whole.shape[1]), scale, wrong[:, None])
    consider = None if known is None else Consider(samples.known[:, k : k + 1], known)
    solved = estimate(whole[:, None], torque[:, None], options.fit, consider, prior=prior)
    values, grown = _without_noise(solved, whole, wrong)
    m = len(names)
    return names, values[:m], solved.std[:m] * grown[:m], solved.identifiable[:m]


def _without_noise(solved: Estimate, columns: Array, noise: Array) -> tuple[Array, Array]:
    """Values without the bias towards zero by noise in the columns (Fuller 1987), and how much each value grew."""
    seen, values, grown = solved.identifiable, solved.values.copy(), np.ones(len(solved.values))
    weight = solved.weights[:, :1] * solved.scale[seen]
    whole, wrong = columns[:, seen] * weight, noise[:, seen] * weight
    squares, of_noise = whole.T @ whole, wrong.T @ wrong
    start = values[seen] / solved.scale[seen]
    if not seen.any() or np.linalg.eigvalsh(squares - 2.0 * of_noise)[0] <= 0:
        return values, grown
    moved = np.linalg.solve(squares - of_noise, squares @ start)
    values[seen] = moved * solved.scale[seen]
    growth = np.divide(moved, start, out=np.ones_like(start), where=start != 0)
    grown[seen] = np.clip(np.abs(growth), 1.0, 2.0)
    return values, grown


def _rows(
    joint: Joint, names: Sequence[str], values: Array, std: Array, seen: NDArray[np.bool_], relative: float
) -> list[NumberRow]:
    """The rows of a joint; the uncertainty includes that of the torque constant."""
    rows = []
    for name, value, own, is_seen in zip(names, values.tolist(), std.tolist(), seen.tolist(), strict=True):
        unit = unit_of(joint.type.effort_unit, UNITS[name])
        if not is_seen or (name == STIFFNESS and value <= 0):
            rows.append(NumberRow(joint.name, name, np.nan, np.inf, unit, False, UNSEEN))
            continue
        whole = float(np.hypot(own, relative * value))
        word = IDENTIFIED if whole < IDENTIFIED_SHARE * abs(value) else WEAK
        rows.append(NumberRow(joint.name, name, value, whole, unit, word is IDENTIFIED, word))
    return rows


def _notes(chain: Mechanism, resting: NDArray[np.bool_], rows: Sequence[NumberRow]) -> tuple[str, ...]:
    names = [name for name, rests in zip(chain.v_names, resting.tolist(), strict=True) if rests]
    unknown = [row.joint for row in rows if row.name == STIFFNESS and not row.seen]
    notes = []
    if names:
        notes.append(f"joint(s) {listed(names)} stand still, so their stiffness is not known")
    if unknown:
        notes.append(
            f"the log does not determine the stiffness of joint(s) {listed(unknown)}: their deflections are small, or "
            "follow the motor's acceleration; state drive_inertia in [elasticity], or record larger torques"
        )
    return tuple(notes)
