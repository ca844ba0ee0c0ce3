"""Compares the logs that one linear fit uses: how much each log says of each parameter, and which log contradicts the
others.

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
from psdmc.calibration.identify.least_squares import Rows, collected, residual_of
from psdmc.calibration.identify.linear_problem import LinearProblem
from psdmc.calibration.identify.residuals import spread, widening
from psdmc.calibration.logs.log import Array

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
