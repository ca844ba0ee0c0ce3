"""Computes the certificate of a finished model: the largest relative error of each joint torque at random states.

The errors are differences between the model's torques and those of the recursive Newton-Euler algorithm. The derivation
did not use these states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.derivation.scaled import orthonormal
from psdmc.dynamics.coordinates import normalized
from psdmc.dynamics.frames import Frame, base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import moving_map
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.spatial import body_from_parameters
from psdmc.errors import DerivationError, InternalError
from psdmc.model import evaluate
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import RANGES, states_of
from psdmc.reproducible import times
from psdmc.robot.mechanism import (
    BODY_PARAMETERS,
    PARAMETER_NAMES,
    PARAMETERS_PER_LINK,
    Array,
    Mechanism,
    Placement,
)

Long = NDArray[Any]

States = Sequence[Sequence[Long]]
"""q, qd and qdd, a list of n arrays each."""

SEED = 19_041_490
SAMPLES = 64
"""Fresh states per certificate."""

WORST_ALLOWED = 1e-8
"""Largest error that rounding explains for ordinary robots."""

ROUNDING = 1e-12
"""Share of a joint's largest contribution that rounding can add to its torque: some thousand terms are evaluated in
double."""

SCALES = "check the units of masses, inertias and lengths: these do not belong to one robot"

MOMENTS = [PARAMETER_NAMES.index(name) for name in ("Ixx", "Iyy", "Izz")]
"""Columns of Ixx, Iyy and Izz among a link's parameters."""

DOUBTFUL = 1e-13
"""Where the last digits of a robot's numbers change a torque by more than this share of its largest, the model is
compared in extended precision, and that change is part of the certificate. Ordinary robots stay below 2e-14."""

PROMISED = 1e-11
"""Largest certificate of such a robot."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Torque errors of a model at random states, relative to each joint's largest torque, and the data to judge them.

    model       the model
    x           (11 n,) standard parameters of the n links (masses, first moments, inertias, drive inertias)
    states      q, qd, qdd
    reference   (states, n) torques by the Newton-Euler algorithm
    errors      (n,) of the torques that the model computes, from E and P (exponents and coefficients) if it has them
    plain       (n,) of torques computed from the regressor and base parameters alone; zero if they were not computed
    last_digit  (n,) relative torque change if the last digits of the robot's numbers change; zero if below DOUBTFUL for
                all joints
    """

    model: DynamicsModel
    x: Array
    states: States
    reference: Array
    errors: Array
    plain: Array
    last_digit: Array


def certificate(model: DynamicsModel) -> Array:
    """Return the certificate (n,) of a model: for each joint, the largest torque error divided by its largest torque.

    The error is the difference from the Newton-Euler algorithm at random states. If the robot's masses and inertias are
    unknown, random values take their place. Raises DerivationError or InternalError if an error is too large.
    """
    return judged(measured(model))


def measured(model: DynamicsModel) -> Measured:
    """Compare the model's torques with those of the Newton-Euler algorithm at SAMPLES random states, and return the
    errors."""
    rng = np.random.default_rng(SEED)
    x, theta = _parameters(model, rng)
    chain, none = model.mechanism, np.zeros(model.nv)
    q, qd, qdd = states_of(chain, rng, SAMPLES)
    states = (list(q.T), list(qd.T), list(qdd.T))
    with np.errstate(over="ignore", invalid="ignore"):
        torques = model.torques_for(theta, q, qd, qdd)
        last_digit = last_digit_effect(chain, x, states)
        if not np.any(last_digit > DOUBTFUL):
            reference = evaluate.torques(chain, x, [q, qd, qdd])
            return Measured(model, x, states, reference, relative_errors(torques, reference), none, none)
        reference = extended_torques(chain, x, states)
        plain = replace(model, expansion=None).torques_for(theta, q, qd, qdd)
        errors = relative_errors(torques, reference)
        return Measured(model, x, states, reference, errors, relative_errors(plain, reference), last_digit)


def judged(found: Measured) -> Array:
    """Return the certificate (n,), the largest relative torque error of each joint, or raise an error if one is too
    large.

    An error above WORST_ALLOWED raises DerivationError if the robot's own numbers are the cause, else InternalError.
    Such numbers overflow, or make a joint's torque a small difference of large contributions. If the torques are
    sensitive to the last digits of the robot's numbers, an error above PROMISED also raises DerivationError.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        worst = np.maximum(found.errors, found.plain)
        known = np.maximum(worst, found.last_digit)
        if not np.all(worst <= WORST_ALLOWED):
            raise _failure(found, worst)
        if found.last_digit.any() and not np.all(known <= PROMISED):
            raise _too_fine(found, known)
    return known


def _too_fine(found: Measured, known: Array) -> DerivationError:
    """The error that names the joint whose torque is not known, or not found, to PROMISED, with the remedy."""
    chain, worst = found.model.mechanism, int(np.argmax(known))
    joint, expected = chain.joints[chain.rate_joints[worst]], f"expected {PROMISED:g} at most"
    unit = "N" if joint.type.length_order else "N m"
    largest = np.abs(found.reference[:, worst]).max()
    whose = (
        f"'{chain.name}': joint '{joint.name}': its largest torque, {largest:.2g} {unit}, is beside loads "
        f"{found.last_digit[worst] / LAST:.0e} times as large"
    )
    if found.last_digit[worst] > PROMISED:
        return DerivationError(
            f"{whose}: the last digit of the robot's numbers changes it by {known[worst]:.1e} of itself, {expected}",
            f"check the units of masses, inertias and lengths of '{joint.name}' and what hangs on it. If they are "
            "right, make this joint fixed, or end the chain before it with --tip",
        )
    without = np.maximum(found.plain, found.last_digit).max()
    if found.model.expansion is not None and without <= PROMISED:
        return DerivationError(
            f"{whose}: E and P leave errors of {known[worst]:.1e} of it, {expected}",
            f"derive with --no-expand: base parameters alone leave {without:.1e}",
        )
    return DerivationError(
        f"{whose}: double precision leaves errors of {known[worst]:.1e} of it, {expected}", SCALES
    )


def _failure(found: Measured, errors: Array) -> DerivationError | InternalError:
    """The error for torques that are off by more than WORST_ALLOWED: a DerivationError where the robot's numbers are
    the cause, else an InternalError."""
    chain, largest = found.model.mechanism, np.abs(found.reference).max(axis=0)
    cancelled = _contributions(chain, found.x, found.states) / np.where(largest > 0, largest, 1.0)
    worst = int(np.argmax(np.where(np.isfinite(errors), errors, np.inf)))
    joint = chain.joint_names[chain.rate_joints[worst]]
    name = f"'{chain.name}': joint '{joint}'"
    if not np.isfinite(cancelled).all():
        return DerivationError(f"{name}: its torque overflows double precision", SCALES)
    if np.all(errors <= np.maximum(WORST_ALLOWED, ROUNDING * cancelled)):
        return DerivationError(
            f"{name}: its torque is the difference of contributions {cancelled[worst]:.1g} times as large; double "
            f"precision leaves errors of {errors[worst]:.2g} of it",
            SCALES,
        )
    if np.any(found.last_digit > PROMISED):
        return _too_fine(found, np.maximum(errors, found.last_digit))
    return InternalError(
        f"joint '{joint}': the derived model is off Newton-Euler by {errors[worst]:.2g} of its largest torque"
    )


def _contributions(chain: Mechanism, x: Array, states: States) -> Array:
    """(n,) largest sum of the magnitudes that all parameters contribute to each joint's torque. The algorithm computes with
    second moments, which are differences of the moments of inertia: each of these contributes as much as their sum."""
    links = np.abs(x.reshape(-1, PARAMETERS_PER_LINK))
    links[:, MOMENTS] = links[:, MOMENTS].sum(axis=1, keepdims=True)
    values = links.reshape(-1)
    wanted = frozenset(np.flatnonzero(values).tolist())
    places = [joint.link_frame for joint in chain.joints]
    q, qd, qdd = states
    rows = regressor(frames_of(chain), places, wanted, q, qd, qdd, base_acceleration(chain))
    sums = [sum(np.abs(entry) * values[p] for p, entry in row.items()) for row in rows]
    return np.array([np.max(total) for total in sums])


def relative_errors(values: Array, reference: Array) -> Array:
    """(n,) for each column, the largest difference relative to the column's largest magnitude. The difference is
    absolute if that magnitude is zero."""
    largest = np.abs(reference).max(axis=0)
    errors: Array = np.abs(values - reference).max(axis=0) / np.where(largest > 0, largest, 1.0)
    return errors


def _parameters(model: DynamicsModel, rng: np.random.Generator) -> tuple[Array, Array]:
    """Standard and base parameters to certify with."""
    if model.theta_b is not None:
        return np.nan_to_num(model.mechanism.parameters.reshape(-1)), np.asarray(model.theta_b)
    span = model.mechanism.parameter_span
    x: Array = times(span, np.asarray(rng.normal(size=span.shape[1])))
    return x, times(model.B, x)


# How much a robot's torques change with the last digits of its numbers: no model can be more accurate. A direction that a
# file gives to 16 digits is uncertain by 1e-16 rad. That changes the moment about an axis of 100 N that act 3 m away by some
# 1e-14 N m: negligible, unless that axis itself moves no more than a gram at a micrometre.
DIGIT_SEED = 18_890_401
DRAWS = 4
"""How many robots with changed numbers are computed."""

LAST = 2.0**-53
"""Half a unit in the last place of a double between one and two: in rad for a direction, as a share for any other
number."""

STEP = 2.0**-36
"""The change that is computed and then scaled down to LAST: far above rounding, and small enough for torques to be
linear in it."""


class Numbers(NamedTuple):
    """All numbers that describe a robot's geometry and masses, in one floating-point precision.

    places       n pairs of rotation (3, 3) and translation (3,), m: joint frames in the frames of their parents
    link_frames  n such pairs: link frames in joint frames
    parameters   (n, 11) standard parameters of each link: mass, first moments, inertia, drive inertia
    """

    places: Sequence[tuple[Long, Long]]
    link_frames: Sequence[tuple[Long, Long]]
    parameters: Long


def last_digit_effect(chain: Mechanism, x: Array, states: States) -> Array:
    """Compute how sensitive each joint's torque is to rounding of the robot's numbers, (n,).

    This is the largest change of the torque if all numbers change by LAST, up or down at random. It is relative to that
    joint's largest torque, or absolute if that is zero.
    """
    rng = np.random.default_rng(DIGIT_SEED)
    numbers = _numbers(chain, x, np.asarray, np.dtype(np.float64))
    torques = _torques(chain, numbers, states)
    largest = np.abs(torques).max(axis=0)
    changes = [
        np.abs(_torques(chain, _changed(numbers, rng), states) - torques).max(axis=0) for _ in range(DRAWS)
    ]
    effect: Array = LAST / STEP * np.max(changes, axis=0) / np.where(largest > 0, largest, 1.0)
    return effect


def extended_torques(chain: Mechanism, x: Array, states: States) -> Array:
    """Compute torques (states, n), N m or N, by Newton-Euler in extended precision. The rotations are orthonormal to
    all digits of this precision."""
    long = np.dtype(np.longdouble)
    numbers = _numbers(chain, x, orthonormal, long)
    vectors = [[vector.astype(long) for vector in one] for one in states]
    return _torques(chain, numbers, vectors).astype(np.float64)


def _numbers(
    chain: Mechanism, x: Array, turned: Callable[[Array], Long], precision: np.dtype[Any]
) -> Numbers:
    def placed(place: Placement) -> tuple[Long, Long]:
        return turned(place.rotation), place.translation.astype(precision)

    return Numbers(
        [placed(joint.placement) for joint in chain.joints],
        [placed(joint.link_frame) for joint in chain.joints],
        x.reshape(-1, PARAMETERS_PER_LINK).astype(precision),
    )


def _changed(numbers: Numbers, rng: np.random.Generator) -> Numbers:
    """The numbers, each changed by STEP up or down. Zeros stay, except those of rotations, which are cosines of right
    angles; a frame that is not turned at all stays so, as nothing in it was rounded."""

    def scaled(values: Long) -> Long:
        return np.asarray(values * (1.0 + STEP * rng.choice([-1.0, 1.0], values.shape)))

    def turned(rotation: Long) -> Long:
        if np.array_equal(rotation, np.eye(3)):
            return rotation
        a, b, c = STEP * rng.choice([-1.0, 1.0], 3)
        return np.asarray(rotation + times(np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]]), rotation))

    return Numbers(
        [(turned(rotation), scaled(translation)) for rotation, translation in numbers.places],
        [(rotation, scaled(translation)) for rotation, translation in numbers.link_frames],
        scaled(numbers.parameters),
    )


def _torques(chain: Mechanism, numbers: Numbers, states: States) -> Long:
    frames = [_frame(frame, *place) for frame, place in zip(frames_of(chain), numbers.places, strict=True)]
    bodies = [
        body_from_parameters(list(times(moving_map(*place), row[:BODY_PARAMETERS])))
        for place, row in zip(numbers.link_frames, numbers.parameters, strict=True)
    ]
    drives = list(numbers.parameters[:, BODY_PARAMETERS])
    q, qd, qdd = states
    torques = inverse_dynamics(frames, bodies, drives, q, qd, qdd, base_acceleration(chain))
    count = len(q[0])
    return np.stack([np.broadcast_to(torque, (count,)) for torque in torques], axis=1)


def _frame(frame: Frame, rotation: Long, translation: Long) -> Frame:
    rows = tuple(tuple(row) for row in rotation)
    return replace(frame, rotation=rows, translation=tuple(translation))  # type: ignore[arg-type]


# How much a robot's torques change by snapping.
SNAP_SEED, SNAP_SAMPLES = 31_416, 256


def snap_effect(snapped: Mechanism, unsnapped: Mechanism) -> Array | None:
    """Return (nv,) the largest torque change at random states, N m or N, from replacing rounded angles by exact ones.

    An example is 1.5708 rad, which is replaced by a right angle. The result is None if parameters are unknown.
    """
    if np.isnan(snapped.parameters).any() or np.isnan(unsnapped.parameters).any():
        return None

    def torques(chain: Mechanism) -> Array:
        rng = np.random.default_rng(SNAP_SEED)
        q, qd, qdd = (
            limit * rng.uniform(-1.0, 1.0, (size, SNAP_SAMPLES))
            for limit, size in zip(RANGES, (chain.nq, chain.nv, chain.nv), strict=True)
        )
        return evaluate.torques(chain, chain.parameters, [normalized(frames_of(chain), q).T, qd.T, qdd.T])

    return np.asarray(np.max(np.abs(torques(snapped) - torques(unsnapped)), axis=0))
