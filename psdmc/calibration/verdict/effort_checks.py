"""Checks unit, sign and time of each joint's torque.

Unit and sign follow from the gain and from the power that friction takes. The gain is the measured torque over the
torque from the robot file's theta_b. For the delay between motion and torque, the torque of every sample is also taken
from earlier and later times. Base parameters, friction and offsets are fitted for each of these delays. The result is
the delay with the best fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psdmc.calibration.identify.motor_model import Coupling
from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.evidence import Evidence, Shifted
from psdmc.model.grounds import Delay
from psdmc.robot.mechanism import DRIVE

VISIBLE_SHARE = 0.05
"""Least ratio of the file's torque, without friction and drive inertia, to the measured torque's variation (RMS) for
its gain to count: below it a wrong wrist mass in the file looks like a wrong unit."""
SETTLED = 0.25
"""Largest standard deviation of a gain that counts, relative to the gain (or to the whole log's gain)."""
LEADING = 0.5
"""Correlation with the file's torque from which the joint that feels it most sets the log's scale."""
CLUSTERS = 30
"""Stretches of time whose errors may be dependent, for standard deviations."""
RANK_TOLERANCE = 1e-3
"""Share of the largest singular value below which a direction of scaled columns is noise."""
FEWEST = 8
"""Samples per unknown of a joint below which its friction is not judged."""


@dataclass(frozen=True, slots=True)
class Gain:
    """The ratio of measured torque to the torque from the file; NaN if there is none. `visible`: whether it is
    reliable."""

    value: float
    std: float
    visible: bool


@dataclass(frozen=True, slots=True)
class Power:
    """The mean power that friction takes at a joint, W, with its standard deviation; NaN if it cannot be determined."""

    value: float
    std: float


def joint_gains(evidence: Evidence) -> tuple[Gain, ...]:
    """Return the gain of each joint: the ratio of the measured torque to the torque from the robot file's parameters.

    The ratio comes from a regression that also contains friction, and drive inertia if the file does not give it. If
    motors drive several joints together, the gains are those of the motors.
    """
    evidence = evidence.of_motors()
    by_file = evidence.file_torque()
    if by_file is None:
        return tuple(Gain(np.nan, np.nan, False) for _ in range(evidence.n))
    lines = [_line(evidence, by_file, k) for k in range(evidence.n)]
    first = max(lines, key=lambda line: line.size)
    # the log's unit: gain of the joint whose torque by the file is largest; one if that joint's torque does not follow it
    scale = abs(first.gain) if first.correlation >= LEADING else 1.0
    gains = []
    for line in lines:
        seen = line.size > 0 and scale * line.size >= VISIBLE_SHARE * line.all_of_it
        settled = line.std <= SETTLED * max(abs(line.gain), scale)
        gains.append(Gain(line.gain, line.std, bool(seen and settled)))
    return tuple(gains)


@dataclass(frozen=True, slots=True)
class _Line:
    """measured = gain * file; `size` RMS of the file's torque beside the other columns, `all_of_it` of the measured."""

    gain: float
    std: float
    size: float
    all_of_it: float
    correlation: float


def _line(evidence: Evidence, by_file: Array, k: int) -> _Line:
    """Frisch and Waugh: both sides less what friction explains, then a slope."""
    beside = basis(nuisance(evidence, k))
    x = _less(beside, by_file[:, k])
    y = _less(beside, evidence.torque[:, k])
    power = float(x @ x)
    variation = float(np.std(evidence.torque[:, k]))
    if power <= (1e-9 * np.linalg.norm(by_file[:, k])) ** 2:
        return _Line(np.nan, np.inf, 0.0, variation, 0.0)
    gain = float(x @ y) / power
    left = y - gain * x
    std = float(np.sqrt(clustered(x[:, None] * left[:, None])[0, 0])) / power
    explained = abs(gain) * np.sqrt(power)
    whole = float(np.hypot(explained, np.linalg.norm(left)))
    correlation = explained / whole if whole > 0 else 0.0
    return _Line(gain, std, float(np.sqrt(power / len(x))), variation, correlation)


def nuisance(evidence: Evidence, k: int) -> Array:
    """Return regressor columns (N, 3 or 4) for joint k, besides the robot file's torque, in the regression of the gain.

    The columns are Coulomb friction, viscous friction, offset, and acceleration if the file has no drive inertia.
    """
    columns = [evidence.sign[:, k], evidence.qd[:, k], np.ones(len(evidence))]
    drive = evidence.model.mechanism.parameters[k, DRIVE]
    if not drive > 0:
        columns.append(evidence.qdd[:, k])
    return np.stack(columns, axis=1)


def friction_powers(evidence: Evidence) -> tuple[Power, ...]:
    """Return the power of Coulomb and viscous friction of each joint (of its motor if motors are coupled). All base
    parameters of the joint are fitted, too."""
    evidence = evidence.of_motors()
    columns = evidence.columns()
    return tuple(_power(evidence, columns[:, k], k) for k in range(evidence.n))


def _power(evidence: Evidence, rigid: Array, k: int) -> Power:
    unknown = Power(np.nan, np.nan)
    beside = basis(np.column_stack([rigid, np.ones(len(evidence))]))
    if len(evidence) < FEWEST * (beside.shape[1] + 2) or not evidence.qd[:, k].any():
        return unknown
    rubbing = np.stack([evidence.sign[:, k], evidence.qd[:, k]], axis=1)
    x = _less(beside, rubbing)
    y = _less(beside, evidence.torque[:, k])
    size: Array = np.linalg.norm(x, axis=0)
    if np.any(size <= RANK_TOLERANCE * np.linalg.norm(rubbing, axis=0)):
        return unknown
    inverse = np.linalg.pinv((x / size).T @ (x / size), rcond=RANK_TOLERANCE**2) / np.outer(size, size)
    values = inverse @ (x.T @ y)
    covariance = inverse @ clustered(x * (y - x @ values)[:, None]) @ inverse
    weight = rubbing.T @ evidence.qd[:, k] / len(evidence)
    return Power(float(weight @ values), float(np.sqrt(np.maximum(weight @ covariance @ weight, 0.0))))


def basis(columns: Array) -> Array:
    """Return an orthonormal basis (N, rank) of the space that regressor columns (N, m) span.

    Columns are first scaled to unit length. Directions with tiny singular values are left out, because they are only
    noise.
    """
    scale: Array = np.linalg.norm(columns, axis=0)
    kept: Array = columns[:, scale > 0] / scale[scale > 0]
    if not kept.shape[1]:
        return kept
    left, singular, _ = np.linalg.svd(kept, full_matrices=False)
    return np.asarray(left[:, singular > RANK_TOLERANCE * singular[0]])


def _less(explained: Array, values: Array) -> Array:
    """The values without their part in an orthonormal basis."""
    return np.asarray(values - explained @ (explained.T @ values))


def clustered(scores: Array) -> Array:
    """Return the covariance of a sum of N score vectors (N, m) whose neighbours in time may be correlated.

    A score is a sample's residual times its regressor row. Source: Liang and Zeger 1986.
    """
    count = min(CLUSTERS, len(scores))
    sums = np.zeros((count, scores.shape[1]))
    np.add.at(sums, np.arange(len(scores)) * count // len(scores), scores)
    return np.asarray(sums.T @ sums * count / max(count - 1, 1))


ROUNDS = 3
"""Fits: the first weights joints by their torques, the others by what the fit before leaves of these."""
SMALLEST_SHARE = 1e-3
"""Of a joint's torque that counts as left: ideal sensors leave less, and rounding is no information."""
SURE = 3.0
"""Standard deviations from zero ..."""
LIKELIER = 25.0
"""... and logarithm of the likelihood that the best delay gains on none, for a delay to be there. The best of a hundred
delays gains 5 on average where only noise is fitted, and 11 on noise whose samples depend on each other."""
BELIEVED = 0.7
"""Mean over joints of the share of torque that the fit explains at the best delay: a log of other faults says nothing of
time."""


def delays_of(
    regressor: Regressor, logs: Sequence[Shifted], coupling: Coupling | None, known: float = 0.0
) -> tuple[Delay, ...]:
    """Return the delay between motion and torque in each log, in addition to the delay `known`, s.

    Logs that are too short for a fit of their own are fitted together.
    """
    alone = [
        log
        for log in logs
        if log.torque[..., 0].size >= FEWEST * _columns(regressor, log, coupling).shape[-1]
    ]
    rest = [log for log in logs if not any(log is one for one in alone)]
    groups = [[log] for log in alone] + ([rest] if rest else [])
    found = [_delay(regressor, group, coupling, known) for group in groups]
    return tuple(delay for delay in found if delay is not None)


def _columns(regressor: Regressor, log: Shifted, coupling: Coupling | None) -> Array:
    return with_friction(regressor.regressor(log.q, log.qd, log.qdd), log.sign, log.speed, coupling)


def with_friction(rigid: Array, sign: Array, speed: Array, coupling: Coupling | None) -> Array:
    """Return columns (N, n, l + 3 n) of base parameters, Coulomb and viscous friction and offsets of n joints. If motors
    drive several joints together, friction is that of the motors, as it acts on the joints.

    rigid        (N, n, l) columns of base parameters
    sign, speed  (N, n) smooth sign of the motors' speed, and this speed
    """
    n = rigid.shape[1]
    onto = np.eye(n) if coupling is None else coupling.inverse
    rubbing = [np.einsum("tk,kj->tjk", part, onto) for part in (sign, speed)]
    constant = np.broadcast_to(np.eye(n), (len(rigid), n, n))
    return np.concatenate([rigid, *rubbing, constant], axis=2)


def _delay(
    regressor: Regressor, logs: Sequence[Shifted], coupling: Coupling | None, known: float
) -> Delay | None:
    """One delay of some logs; None where they are too few for a fit."""
    columns = np.concatenate([_columns(regressor, log, coupling) for log in logs])
    torque, lags = np.concatenate([log.torque for log in logs]), logs[0].lags
    samples, n, width = columns.shape
    name = ", ".join(log.log for log in logs)
    zero = int(np.abs(lags - known).argmin())
    size = torque[:, :, zero].std(axis=0)
    moved = size > 0
    if samples * n < FEWEST * width or not moved.any():
        return None
    weights = np.where(moved, 1.0 / np.where(moved, size, 1.0), 0.0)
    for _ in range(ROUNDS):
        fitted = basis((columns * weights[:, None]).reshape(-1, width))
        target = (torque * weights[:, None]).reshape(samples * n, -1)
        left = target - fitted @ (fitted.T @ target)
        squares = (left**2).sum(axis=0)
        best = int(squares.argmin())
        scatter = np.sqrt((left[:, best].reshape(samples, n) ** 2).mean(axis=0))
        share = scatter / np.where(moved, weights * size, 1.0)
        weights = weights / np.maximum(scatter, SMALLEST_SHARE * weights * size + ~moved)
    gained = 0.5 * samples * n * float(np.log(squares[zero] / squares[best]))
    explains = gained > LIKELIER and float(np.mean(1.0 - share[moved] ** 2)) > BELIEVED
    if not 0 < best < len(lags) - 1:
        return Delay(name, float(lags[best]) - known, np.inf, explains)
    before, here, after = squares[best - 1 : best + 2]
    step = float(lags[1] - lags[0])
    value = float(lags[best]) + 0.5 * step * float((before - after) / (before - 2.0 * here + after))
    rate = (left[:, best + 1] - left[:, best - 1]) / (2.0 * step)
    std = _deviation(rate.reshape(samples, n), left[:, best].reshape(samples, n))
    return Delay(name, value - known, std, explains and abs(value - known) > SURE * std)


def _deviation(rate: Array, left: Array) -> float:
    """Return the standard deviation of the delay, from the residuals (N, n) and their change per delay. It comes from
    stretches of time, and from joints left out one at a time, as a joint's friction may look like a delay."""
    power, pull = (rate**2).sum(axis=0), (rate * left).sum(axis=0)
    by_time = float(clustered((rate * left).sum(axis=1)[:, None])[0, 0]) / float(power.sum()) ** 2
    others = power.sum() - power
    moves = (pull.sum() - pull)[others > 0] / others[others > 0] - pull.sum() / power.sum()
    count = max(len(moves), 1)
    return float(np.sqrt(by_time + (count - 1) / count * float((moves**2).sum())))
