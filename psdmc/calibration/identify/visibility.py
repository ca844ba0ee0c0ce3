"""Determines which unknowns the data show (alone, weakly, only in combination with others, or not at all), and which
ones are essential.

If a user wants only essential parameters, psdmc drops the others: they keep the values of the prior, from which the data
do not differ significantly. Parameters are dropped one after the other, the largest relative standard deviation first.
An F-test over all dropped parameters decides when to stop (Khalil and Dombre 2002, section 12.4). The statistic is
Wald's, with the reported covariance, which takes correlated residuals into account.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from psdmc.calibration.identify.estimate import Estimate, FitOptions
from psdmc.calibration.identify.least_squares import ROUNDING
from psdmc.calibration.identify.physical import whitening_of
from psdmc.calibration.logs.foreign_bytes import listed
from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import IDENTIFIED, SHOWN, WEAK, Remark


@dataclass(frozen=True, slots=True)
class EssentialOptions:
    """Options for dropping parameters that the data do not need.

    relative      relative standard deviation above which psdmc tries to drop a parameter
    significance  significance level of the F-test: the probability that a parameter is kept although the prior is true
    """

    relative: float = 0.5
    significance: float = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Essential:
    """An estimate in which some of the m parameters keep the values of the prior, and the others are fitted again.

    dropped  (m,) whether a parameter keeps the prior's value
    f        F statistic over all dropped parameters
    limit    largest value of f at which parameters are dropped; NaN if none was dropped
    """

    estimate: Estimate
    dropped: NDArray[np.bool_]
    f: float
    limit: float


def essential(
    solved: Estimate, start: Array, samples: int, options: EssentialOptions, fit: FitOptions | None = None
) -> Essential:
    """Return the estimate in which parameters that the data do not need keep the values of the prior.

    solved   the estimate of all m parameters
    start    (m,) the prior's values, which dropped parameters get
    samples  number of independent samples that were fitted, all joints together
    fit      options of the fit that found `solved`; None: the default ones
    """
    problem = _Problem(solved, start, max(samples - solved.rank, 1))
    dropped, needed = np.zeros(len(start), dtype=bool), np.zeros(len(start), dtype=bool)
    while True:
        values, std = problem.restricted(dropped)
        size = np.maximum(np.abs(values), np.finfo(float).tiny)
        relative = np.where(dropped | needed, 0.0, std / size)
        worst = int(np.argmax(relative))
        if relative[worst] <= options.relative:
            break
        tried = dropped.copy()
        tried[worst] = True
        if problem.f(tried) <= problem.limit(tried, options.significance):
            dropped = tried
        else:
            needed[worst] = True
    f, limit = problem.f(dropped), problem.limit(dropped, options.significance)
    unseen_share = (fit or FitOptions()).unseen_share
    return Essential(_reduced(solved, problem, dropped, unseen_share), dropped, f, limit)


class _Problem:
    """The cost of any vector, in variances: |W (v - values)|^2, W by the reported covariance and the prior's."""

    def __init__(self, solved: Estimate, start: Array, freedom: int) -> None:
        self.values, self.start, self.freedom = solved.values, start, freedom
        whitening = whitening_of(solved.total_covariance + solved.prior_covariance)
        self.information = whitening.T @ whitening

    def restricted(self, dropped: NDArray[np.bool_]) -> tuple[Array, Array]:
        """Return the best values of all parameters if the dropped ones keep the prior's values, and the standard
        deviations. Those of dropped parameters are zero."""
        covariance = self.covariance(dropped)
        free = ~dropped
        moved = np.where(dropped, self.start - self.values, 0.0)
        values = self.values + moved
        values[free] -= (covariance @ (self.information @ moved))[free]
        return values, np.sqrt(np.maximum(np.diag(covariance), 0.0))

    def covariance(self, dropped: NDArray[np.bool_]) -> Array:
        """Return the covariance (m, m) if the dropped parameters are known exactly: their rows and columns are zero."""
        free = np.flatnonzero(~dropped)
        covariance = np.zeros_like(self.information)
        own = self.information[np.ix_(free, free)]
        size = 1.0 / np.sqrt(np.diag(own))
        covariance[np.ix_(free, free)] = np.linalg.inv(own * np.outer(size, size)) * np.outer(size, size)
        return covariance

    def f(self, dropped: NDArray[np.bool_]) -> float:
        """Return the F statistic for the dropped parameters. It is the increase of the sum of squared residuals (in
        variances) if they keep the prior's values, divided by their number."""
        if not dropped.any():
            return 0.0
        away = self.restricted(dropped)[0] - self.values
        return float(away @ self.information @ away) / int(dropped.sum())

    def limit(self, dropped: NDArray[np.bool_], significance: float) -> float:
        count = int(dropped.sum())
        return float(stats.f.isf(significance, count, self.freedom)) if count else float("nan")


def _reduced(
    solved: Estimate, problem: _Problem, dropped: NDArray[np.bool_], unseen_share: float
) -> Estimate:
    """The estimate of the free entries; hidden directions are those that are left with the dropped ones known.

    What is kept stands for what was dropped beside it. Its standard deviation is that of itself: the whole fit's, and how
    far dropping has moved it.
    """
    values, _ = problem.restricted(dropped)
    moved = np.where(dropped, 0.0, values - solved.values)
    whole = np.where(np.outer(dropped, dropped), 0.0, problem.covariance(np.zeros_like(dropped)))
    hidden = _within(solved.unseen, dropped)
    covariance = problem.covariance(dropped)
    share = np.sum(hidden**2, axis=1)
    return replace(
        solved,
        values=values,
        covariance=covariance,
        considered=np.zeros((len(values), 0)),
        total_covariance=whole + np.outer(moved, moved),
        unseen=hidden,
        prior_std=0.0,  # what hidden directions leave open is in the covariance
        identifiable=(share < unseen_share) & ~dropped,
        rank=int((~dropped).sum()) - hidden.shape[1],
    )


def _within(unseen: Array, dropped: NDArray[np.bool_]) -> Array:
    """Directions of a subspace that have nothing of the dropped entries."""
    if not unseen.shape[1] or not dropped.any():
        return unseen
    _, values, axes = np.linalg.svd(unseen[dropped])
    rank = int(np.sum(values > np.sqrt(ROUNDING)))
    return np.asarray(unseen @ axes[rank:].T)


TOGETHER_WORDS = "only in combination with "
WEAK_SHARE = 0.5
"""Standard deviation, as a share of the value, from which a parameter is called weakly visible: its sign is then
certain by two standard deviations at most."""
INVISIBLE_SHARE = 0.9999
"""Share (squared) of a parameter in unseen directions from which it is not seen at all: a hundredth may remain."""
TOGETHER = 0.2
"""Correlation within unseen directions from which two parameters are said to be visible in combination only."""
NAMED = 4
"""Partners that a message names."""


@dataclass(frozen=True, slots=True, eq=False)
class Visibility:
    """Remarks on what the data show of each of the m unknowns of a fit.

    words       m remarks: "identified", "weakly visible", "only in combination with ...", "not visible: kept at ..."
    determined  (m,) True: the data determine the unknown by itself, however weakly. The unknown then has a standard
                deviation
    """

    words: tuple[Remark, ...]
    determined: NDArray[np.bool_]


def visibility(
    names: Sequence[str],
    values: Array,
    std: Array,
    unseen: Array,
    kept_at: Sequence[str],
    options: FitOptions | None = None,
) -> Visibility:
    """Return a remark for each of m unknowns of a fit on how well the data show the unknown.

    values, std  (m,) final values and their standard deviations
    unseen       (m, k) k directions that the data do not show, in units of plausible sizes
    kept_at      m texts: the value at which an unknown stays if the data do not show the unknown
    """
    limit = (options or FitOptions()).unseen_share
    share = np.minimum(np.sum(unseen**2, axis=1), 1.0)
    size = np.linalg.norm(unseen, axis=1)
    size[size == 0] = 1.0
    together = np.abs(unseen @ unseen.T) / np.outer(size, size)
    words = []
    for j in range(len(names)):
        if share[j] < limit:
            weak = not std[j] < WEAK_SHARE * abs(values[j])
            words.append(WEAK if weak else IDENTIFIED)
        else:
            words.append(_unseen(names, j, share, together[j], limit, kept_at[j]))
    return Visibility(tuple(words), share < limit)


BY_PRIOR = Remark("by the stated prior more than by the data", "stated")


def as_fitted(
    seen: Visibility, kept_at: Sequence[str], dropped: NDArray[np.bool_], stated: NDArray[np.bool_]
) -> Visibility:
    """Return the remarks on m unknowns after a fit that left out unknowns or used a prior.

    dropped  (m,) True: the fit left the unknown out because the data do not need it
    stated   (m,) True: the unknown has a prior with a confidence that the user stated
    """
    words = [
        Remark(f"not essential: kept at {kept_at[k]}", "dropped")
        if dropped[k]
        else BY_PRIOR
        if stated[k] and not known
        else word
        for k, (word, known) in enumerate(zip(seen.words, seen.determined, strict=True))
    ]
    return Visibility(tuple(words), (seen.determined | stated) & ~dropped)


def _unseen(
    names: Sequence[str], j: int, share: Array, together: Array, limit: float, kept_at: str
) -> Remark:
    if share[j] > INVISIBLE_SHARE:
        return Remark(f"not visible: kept at {kept_at}", "invisible")
    partly = (share >= limit) & (share <= INVISIBLE_SHARE) & (together > TOGETHER)
    partners = [k for k in np.argsort(-together, kind="stable") if partly[k] and k != j]
    if not partners:
        return Remark(f"mostly invisible: near {kept_at}", "mostly")
    named = ", ".join(names[k] for k in partners[:NAMED])
    more = f" and {len(partners) - NAMED} more" if len(partners) > NAMED else ""
    return Remark(f"{TOGETHER_WORDS}{named}{more}", "together")


def visibility_warnings(step: str, names: Sequence[str], found: Visibility) -> tuple[str, ...]:
    """Return a sentence for each way in which the data do not show unknowns, friction and offsets included."""
    together = [
        f"{name} (with {words.removeprefix(TOGETHER_WORDS)})"
        for name, words in zip(names, found.words, strict=True)
        if words.code == "together"
    ]
    groups: dict[str, list[str]] = {}
    for name, words in zip(names, found.words, strict=True):
        if words.code not in SHOWN and words.code not in ("together", "dropped"):
            groups.setdefault(words, []).append(name)
    alone = tuple(f"{step}: {', '.join(own)}: {words}" for words, own in groups.items())
    if not together:
        return alone
    return (
        f"{step}: visible only in combination, each as near to the prior as it may be: {'; '.join(together)}",
        *alone,
    )


def weak_notes(step: str, names: Sequence[str], found: Visibility) -> tuple[str, ...]:
    """Return notes with the names of unknowns whose standard deviation is almost as large as their value."""
    weak = [name for name, words in zip(names, found.words, strict=True) if words.code == WEAK.code]
    if not weak:
        return ()
    seen = sum(words.code == IDENTIFIED.code for words in found.words)
    return (
        f"{step}: {seen} of {len(names)} unknowns identified; {len(weak)} weakly visible (standard deviation above "
        f"half of the value): {listed(weak)}",
    )
