"""Finds joints whose friction changes over a log, as it does while a robot warms up.

For each log, the linear fit is extended by friction of this log alone, and by the friction columns times the time, which
runs from -1/2 to 1/2. Their coefficients follow from the score of the common fit; all other unknowns are fitted along.
The standard deviation of the change is the larger of two: one from stretches of time whose residuals may be dependent
(Liang and Zeger 1986), and one from the residuals' autocorrelation (residuals.widening).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from psdmc.calibration.identify.estimate import Estimate
from psdmc.calibration.identify.least_squares import Block, Rows, collected, residual_of, with_rows
from psdmc.calibration.identify.linear_problem import LinearProblem
from psdmc.calibration.identify.log_information import UNSEEN, fitted_logs, white_coordinates
from psdmc.calibration.identify.residuals import widening
from psdmc.calibration.logs.log import Array
from psdmc.friction.terms import OPTIONAL

CHANCE = 1e-4
"""Probability that one of all joints and logs is named although no friction changes."""
MATERIAL = 0.05
"""Share of the joint's friction from which a change matters."""
FEWEST = 120
"""Samples of a log below which its friction is not compared over time: four in each stretch."""
STRETCHES = 30
"""Stretches of time whose residuals may be dependent."""


@dataclass(frozen=True, slots=True)
class FrictionDrift:
    """The change of a joint's friction from the first to the last fitted row of a log, at the log's mean speed.

    change, std  of the torque, in `unit`, and its standard deviation
    share        change as a share of the joint's friction torque
    seconds      time from the first to the last fitted row
    shown        whether the change is significant and large enough to matter
    """

    log: str
    joint: str
    change: float
    std: float
    unit: str
    share: float
    seconds: float
    shown: bool


def friction_drift(
    problem: LinearProblem, solved: Estimate, names: Sequence[str]
) -> tuple[FrictionDrift, ...]:
    """Return the change of the friction of each moving joint over each fitted log. The rows are read in blocks.

    names  of the logs, in the order of their rows
    """
    f, l = len(problem.friction), problem.l
    constant = OPTIONAL.parameters
    rubbing = [k for k, name in enumerate(problem.friction) if name not in constant]
    if not rubbing or not solved.rank:
        return ()
    places = np.array([[l + j * f + k for k in rubbing] for j in range(problem.chain.nv)])
    residual = residual_of(problem.rows, problem.torque, solved.values)
    whole = collected(problem.rows, solved.weights, residual * solved.weights, 0).squares.sum(axis=0)
    white = white_coordinates(solved)
    covariance = white @ np.linalg.inv(white.T @ whole @ white) @ white.T
    found: list[FrictionDrift] = []
    fitted = fitted_logs(problem, solved, names)
    for name, own in fitted:
        weights = solved.weights[own]
        log = _Log(problem.rows.between(own.start, own.stop), problem.time[own], residual[own], weights)
        used = log.time[weights.any(axis=1)]
        if len(used) >= FEWEST:
            seconds = float(used[-1] - used[0])
            turn = (log.time - used[0]) / seconds - 0.5
            sizes, change, variance = _changes(log, turn, places, covariance)
            of_all = np.array([solved.values[own_places] for own_places in places])
            level = np.sum(np.abs(of_all) * sizes, axis=1)
            sure = float(stats.t.isf(0.5 * CHANCE / change.size / len(fitted), STRETCHES - 1))
            for k, joint in enumerate(problem.chain.leading_joints):
                if not level[k] > 0 or not variance[k] > 0:
                    continue
                std, share = float(np.sqrt(variance[k])), float(change[k] / level[k])
                shown = abs(change[k]) > sure * std and abs(share) > MATERIAL
                unit = joint.type.effort_unit
                found.append(
                    FrictionDrift(name, joint.name, float(change[k]), std, unit, share, seconds, shown)
                )
    return tuple(found)


@dataclass(frozen=True, slots=True, eq=False)
class _Log:
    """Rows of one log with time (N,), residual and weights (N, n)."""

    rows: Rows
    time: Array
    residual: Array
    weights: Array


def _changes(
    log: _Log, turn: Array, places: NDArray[np.intp], covariance: Array
) -> tuple[Array, Array, Array]:
    """Mean sizes (n, terms) of friction columns, and changes (n,) of the joints' friction torques with variances.

    `turn` (N,) is the time from -1/2 to 1/2, `covariance` (l, l) the inverse of the whole fit's information."""
    n, terms = places.shape
    columns = places.reshape(-1)
    used = log.weights > 0
    sizes, m, l = np.zeros((n, terms)), 2 * n * terms, len(covariance)
    cross, own, score = np.zeros((l, m)), np.zeros((m, m)), np.zeros(m)
    for block, rows in with_rows(log.rows):
        plain, turned = _weighted(block, log, rows, columns, turn)
        cross += np.tensordot(plain, turned, axes=((0, 1), (0, 1)))
        own += np.tensordot(turned, turned, axes=((0, 1), (0, 1)))
        score += np.einsum("tnm,tn->m", turned, log.residual[rows] * log.weights[rows])
        for k in range(n):
            sizes[k] += np.abs(block.columns[:, k, places[k]][used[rows][:, k]]).sum(axis=0)
    sizes /= np.maximum(used.sum(axis=0), 1)[:, None]
    carried = covariance @ cross
    scale = 1.0 / np.sqrt(np.maximum(np.diag(own), 1e-300))
    inverse = np.linalg.pinv((own - cross.T @ carried) * np.outer(scale, scale), rcond=UNSEEN)
    inverse *= np.outer(scale, scale)
    values = inverse @ score
    place = np.cumsum(used.any(axis=1)) - 1  # of a row among those that are fitted
    stretches = np.maximum(place, 0) * STRETCHES // max(int(place[-1]) + 1, 1)
    left, squares, sums = np.zeros_like(log.residual), np.zeros((n, m, m)), np.zeros((STRETCHES, m))
    for block, rows in with_rows(log.rows):
        plain, turned = _weighted(block, log, rows, columns, turn)
        moved = turned - plain @ carried
        left[rows] = log.residual[rows] * log.weights[rows] - moved @ values
        squares += moved.transpose(1, 2, 0) @ moved.transpose(1, 0, 2)
        np.add.at(sums, stretches[rows], np.einsum("tnm,tn->tm", moved, left[rows]))
    level = np.sum(left**2, axis=0) / np.maximum(used.sum(axis=0), 1)
    by_noise = inverse @ np.tensordot(level * widening(left, used) ** 2, squares, axes=1) @ inverse
    by_time = inverse @ (sums.T @ sums) @ inverse * STRETCHES / (STRETCHES - 1)
    onto = np.zeros((n, m))
    for k in range(n):
        onto[k, (n + k) * terms : (n + k + 1) * terms] = sizes[k]
    variances = [np.einsum("nl,lm,nm->n", onto, each, onto) for each in (by_noise, by_time)]
    return sizes, onto @ values, np.maximum(*variances)


def _weighted(
    block: Block, log: _Log, rows: slice, columns: NDArray[np.intp], turn: Array
) -> tuple[Array, Array]:
    """All columns of a block times the weights; and the friction columns, once more and times the time."""
    plain = block.columns * log.weights[rows][:, :, None]
    rubbing = plain[:, :, columns]
    return plain, np.concatenate([rubbing, rubbing * turn[rows][:, None, None]], axis=2)
