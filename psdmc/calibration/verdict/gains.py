"""Checks unit and sign of each joint's torque, by its gain and by the power that friction takes. The gain is the measured
torque over the torque from the robot file's theta_b."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.calibration.verdict.evidence import Evidence
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
    scale = _scale(lines)
    return tuple(_gain(line, scale) for line in lines)


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


def _scale(lines: list[_Line]) -> float:
    """The log's unit: gain of the joint whose torque by the file is largest; one where that joint's torque does not
    follow it."""
    first = max(lines, key=lambda line: line.size)
    return abs(first.gain) if first.correlation >= LEADING else 1.0


def _gain(line: _Line, scale: float) -> Gain:
    seen = line.size > 0 and scale * line.size >= VISIBLE_SHARE * line.all_of_it
    settled = line.std <= SETTLED * max(abs(line.gain), scale)
    return Gain(line.gain, line.std, bool(seen and settled))


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
