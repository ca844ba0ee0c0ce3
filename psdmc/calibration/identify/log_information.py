"""Compares the logs that one linear fit uses.

It finds how much each log says of each parameter, which log contradicts the others, and over which log friction changes.

Each log i has the information matrix M_i = A_i' W A_i of its weighted columns, and the score s_i = A_i' W r_i of the
residual r_i of the common fit. All results follow from these matrices, without a further fit. The sum of all M_i is M.

The share of log i in the information of parameter k is (M^-1 M_i M^-1)_kk / (M^-1)_kk. It is the relative growth of the
parameter's information, after all other parameters are fitted, per relative growth of M_i. The shares of a parameter
add up to one.

The test for a contradiction compares a log with the fit of the other logs (Chow 1960, in the form of a Wald test). It
uses the scores, whose covariance includes correlated noise (residuals.widening). The noise is that of a fit of the log
alone, so that a contradiction does not count as noise. The logs that contradict most are left out one after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from psdmc.calibration.identify.estimate import Estimate
from psdmc.calibration.identify.least_squares import Block, Rows, collected, residual_of, with_rows
from psdmc.calibration.identify.linear_problem import LinearProblem
from psdmc.calibration.identify.residuals import spread, widening
from psdmc.calibration.logs.log import Array
from psdmc.friction.terms import OPTIONAL

UNSEEN = 1e-6
"""Share of the whole information below which a direction does not count as seen by some of the logs."""
CHANCE = 1e-4
"""Probability of a false alarm in one set of good logs."""
MATERIAL = 1.2
"""Ratio of a log's RMSE by the fit of the others to its RMSE by its own fit, from which a contradiction matters."""
NOISIER, SPREADS = 2.0, 5.0
"""Ratio of a log's own residual to the others' median, and number of their robust standard deviations (of the
logarithm), from which a log is noisier than the others."""
ALONE, MAIN_SHARE = 10.0, 0.8
"""Growth of a standard deviation without a log, and the log's share in the information, from which the parameter depends
on this log alone."""
FEWEST_LOGS = 3
"""Logs of which one can be told from the others."""


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """One log in r white coordinates.

    M_i and the covariance of its score (r, r), the score (r,), the RMSE by its own fit (n,), the RMS of its weighted own
    residual, and its rows with their residual and used entries."""

    name: str
    information: Array
    noise: Array
    score: Array
    rmse: Array
    level: float
    rows: Rows
    residual: Array
    used: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class LogInformation:
    """Shares of the logs of one fit in the information of its l parameters, and how the logs agree.

    logs         names of the I fitted logs
    shares       (I, l) share of each log in the information of each parameter; they add up to one
    std_without  (I, l) factor by which the standard deviation grows without the log; infinite if the parameter is then
                 not determined
    statistics   (I,) chi-square per degree of freedom of each log against all others; near one if they agree
    odd          figures of each log that contradicts the others, the clearest first
    disagree     whether so many logs contradict each other that none can be named
    noisier      names of logs with a larger residual than the others, and the ratio to their median
    """

    logs: tuple[str, ...]
    shares: Array
    std_without: Array
    statistics: Array
    odd: tuple[dict[str, Any], ...]
    disagree: bool
    noisier: tuple[tuple[str, float], ...]


def log_information(problem: LinearProblem, solved: Estimate, names: Sequence[str]) -> LogInformation | None:
    """Return what each log of a linear fit says of the parameters; None if fewer than two logs were fitted.

    The rows are read in blocks, and no more than one block and (l, l) matrices of each log are in memory.

    names  of the logs, in the order of their rows
    """
    fitted = fitted_logs(problem, solved, names)
    if len(fitted) < 2 or not solved.rank:
        return None
    white = white_coordinates(solved)
    residual = residual_of(problem.rows, problem.torque, solved.values)
    parts = []
    for name, own in fitted:
        rows = problem.rows.between(own.start, own.stop)
        parts.append(_part(name, rows, residual[own], solved.weights[own], white))
    whole = np.sum([part.information for part in parts], axis=0)
    inverse = white @ np.linalg.inv(whole)
    variance = np.maximum(np.einsum("kr,kr->k", inverse, white), 1e-300)
    shares = [np.einsum("kr,rs,ks->k", inverse, p.information, inverse) / variance for p in parts]
    without = [np.sqrt(_variance(white, whole, whole - part.information) / variance) for part in parts]
    tests = [_test(part, [other for other in parts if other is not part]) for part in parts]
    statistics = np.array([statistic / max(freedom, 1) for statistic, freedom in tests])
    odd, disagree = _contradictions(parts, white, problem)
    return LogInformation(
        tuple(part.name for part in parts),
        np.array(shares),
        np.array(without),
        statistics,
        odd,
        disagree,
        _noisier(parts),
    )


def white_coordinates(solved: Estimate) -> Array:
    """Return a matrix (l, r) whose columns span the r seen directions of a fit.

    In these coordinates, the fit's information matrix is a multiple of the identity."""
    return solved.scale[:, None] * np.linalg.pinv(solved.whitening[: solved.rank] * solved.scale)


def fitted_logs(problem: LinearProblem, solved: Estimate, names: Sequence[str]) -> list[tuple[str, slice]]:
    """Return name and samples of each log that the fit uses; logs for validation are left out."""
    found, start = [], 0
    for name, count in zip(names, problem.counts, strict=True):
        own = slice(start, start + count)
        start += count
        if solved.weights[own].any():
            found.append((name, own))
    return found


def _part(name: str, rows: Rows, residual: Array, weights: Array, white: Array) -> _Part:
    used = weights > 0
    sums = collected(rows, weights, residual * weights, 1)
    information = white.T @ sums.squares.sum(axis=0) @ white
    score = sums.scores[0] @ white
    inverse, rank = _inverse(information, information)
    own = residual_of(rows, residual, white @ inverse @ score)
    weighted = own * weights
    freedom = max(int(used.sum()) - rank, 1) / int(used.sum())
    level = np.sum(weighted**2, axis=0) / np.maximum(used.sum(axis=0), 1) / freedom
    noise = np.tensordot(level * widening(weighted, used) ** 2, sums.squares, axes=1)
    rmse = spread(own, used) / np.sqrt(freedom)
    size = float(np.sqrt(level.mean()))
    return _Part(name, information, white.T @ noise @ white, score, rmse, size, rows, residual, used)


def _inverse(matrix: Array, of: Array) -> tuple[Array, int]:
    """Inverse of a positive semidefinite matrix in the directions that are not negligible in `of`, and their number."""
    value, vector = np.linalg.eigh(matrix)
    seen = value > UNSEEN * np.trace(of) / len(of)
    return (vector[:, seen] / value[seen]) @ vector[:, seen].T, int(seen.sum())


def _variance(white: Array, whole: Array, rest: Array) -> Array:
    """(l,) variances by the information `rest`; infinite where it leaves a parameter open."""
    value, vector = np.linalg.eigh(rest)
    seen = value > UNSEEN * np.trace(whole) / len(whole)
    by = (white @ vector) ** 2
    hidden = by[:, ~seen].sum(axis=1) > UNSEEN * by.sum(axis=1)
    return np.where(hidden, np.inf, by[:, seen] @ (1.0 / value[seen]))


# Contradictions


def _contradictions(
    parts: Sequence[_Part], white: Array, problem: LinearProblem
) -> tuple[tuple[dict[str, Any], ...], bool]:
    """Figures of the logs that contradict the others, and whether the logs disagree without a majority."""
    left = list(parts)
    odd: list[dict[str, Any]] = []
    while len(left) > 1:
        tests = [_test(part, [other for other in left if other is not part]) for part in left]
        k = int(np.argmax([statistic for statistic, _ in tests]))
        statistic, freedom = tests[k]
        others = [part for part in left if part is not left[k]]
        usual = [t / max(d, 1) for t, d in (_test(p, [o for o in others if o is not p]) for p in others)]
        excess = statistic / max(1.0, float(np.median(usual))) if len(others) > 1 else statistic
        figures = _figures(left[k], others, white, problem, statistic / max(freedom, 1))
        if stats.chi2.sf(excess, max(freedom, 1)) * len(left) > CHANCE or figures["ratio"] < MATERIAL:
            return tuple(odd), False
        odd.append(figures)
        if 2 * len(odd) >= len(parts):
            return tuple(odd[:1]), True
        left = others
    return tuple(odd), False


def _test(part: _Part, others: Sequence[_Part]) -> tuple[float, int]:
    """The Wald statistic of a log against the others, chi-square of this many degrees of freedom if they agree."""
    if not others:
        return 0.0, 0
    rest, noise, score = (
        np.sum([getattr(other, name) for other in others], axis=0)
        for name in ("information", "noise", "score")
    )
    whole = part.information + rest
    value, vector = np.linalg.eigh(whole)
    seen = value > UNSEEN * np.trace(whole) / len(whole)
    root = vector[:, seen] / np.sqrt(value[seen])
    share, turned = np.linalg.eigh(root.T @ part.information @ root)
    both = np.minimum(share, 1.0 - share) > UNSEEN
    onto = (root @ turned[:, both]).T
    own, far = (1.0 - share[both])[:, None] * onto, share[both][:, None] * onto
    gap = own @ part.score - far @ score
    covariance = own @ part.noise @ own.T + far @ noise @ far.T
    return float(gap @ np.linalg.lstsq(covariance, gap, rcond=None)[0]), int(both.sum())


def _figures(
    part: _Part, others: Sequence[_Part], white: Array, problem: LinearProblem, statistic: float
) -> dict[str, Any]:
    """The joint whose torque the other logs' fit predicts worst in this log, compared with the log's own fit."""
    rest, score = (np.sum([getattr(o, name) for o in others], axis=0) for name in ("information", "score"))
    moved = white @ _inverse(rest, rest + part.information)[0] @ score
    rmse = spread(residual_of(part.rows, part.residual, moved), part.used)
    ratio = rmse / np.maximum(part.rmse, 1e-12 + 1e-9 * part.rmse.max())
    k = int(np.argmax(ratio))
    joint = problem.chain.leading_joints[k]
    return {
        "log": part.name,
        "joint": joint.name,
        "rmse": float(rmse[k]),
        "own": float(part.rmse[k]),
        "unit": joint.type.effort_unit,
        "ratio": float(ratio[k]),
        "statistic": statistic,
    }


def _noisier(parts: Sequence[_Part]) -> tuple[tuple[str, float], ...]:
    found = []
    for part in parts if len(parts) >= FEWEST_LOGS else ():
        others = np.log([max(other.level, 1e-300) for other in parts if other is not part])
        middle = float(np.median(others))
        spread = 1.4826 * float(np.median(np.abs(others - middle)))
        above = float(np.log(max(part.level, 1e-300))) - middle
        if above > max(np.log(NOISIER), SPREADS * spread):
            found.append((part.name, float(np.exp(above))))
    return tuple(found)


# Joints whose friction changes over a log, as it does while a robot warms up
#
# For each log, the linear fit is extended by friction of this log alone, and by the friction columns times the time,
# which runs from -1/2 to 1/2. Their coefficients follow from the score of the common fit; all other unknowns are fitted
# along. The standard deviation of the change is the larger of two: one from stretches of time whose residuals may be
# dependent (Liang and Zeger 1986), and one from the residuals' autocorrelation (residuals.widening).

DRIFT_CHANCE = 1e-4
"""Probability that one of all joints and logs is named although no friction changes."""
DRIFT_MATERIAL = 0.05
"""Share of the joint's friction from which a change matters."""
FEWEST_SAMPLES = 120
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
        if len(used) >= FEWEST_SAMPLES:
            seconds = float(used[-1] - used[0])
            turn = (log.time - used[0]) / seconds - 0.5
            sizes, change, variance = _changes(log, turn, places, covariance)
            of_all = np.array([solved.values[own_places] for own_places in places])
            level = np.sum(np.abs(of_all) * sizes, axis=1)
            sure = float(stats.t.isf(0.5 * DRIFT_CHANCE / change.size / len(fitted), STRETCHES - 1))
            for k, joint in enumerate(problem.chain.leading_joints):
                if not level[k] > 0 or not variance[k] > 0:
                    continue
                std, share = float(np.sqrt(variance[k])), float(change[k] / level[k])
                shown = abs(change[k]) > sure * std and abs(share) > DRIFT_MATERIAL
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
