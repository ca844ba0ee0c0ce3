"""Linear estimation shared by the steps: weights, robustness, standard deviations, and what the data cannot see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.calibrate.log import Array

Method = Literal["ols", "wls", "irls"]


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How a linear problem is solved.

    method          ols: all rows alike; wls: each joint by its own residual; irls: wls, and outliers count less (Huber)
    rounds          of reweighting
    huber           residual in standard deviations beyond which irls turns from squares to magnitudes: 1.345 keeps
                    95 % of least squares' efficiency where errors are normal
    rank_tolerance  singular value of the column-scaled problem, relative to the largest, below which a direction is
                    called unseen: states from sensors carry about 1e-4 of noise
    unseen_share    share of a parameter in unseen directions from which it is unidentifiable
    clusters        contiguous stretches whose errors may be dependent, for the robust standard deviations
    """

    method: Method = "wls"
    rounds: int = 6
    huber: float = 1.345
    rank_tolerance: float = 3e-4
    unseen_share: float = 1e-2
    clusters: int = 30


@dataclass(frozen=True, slots=True, eq=False)
class Consider:
    """What an earlier step left uncertain and this one takes as given: its effect is counted, not estimated.

    columns     (N, n, k)  change of (prediction - target) per unit of each quantity
    covariance  (k, k)
    """

    columns: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The solution of target = columns @ values. l unknowns, n joints.

    values            (l,)    zero where unidentifiable
    covariance        (l, l)  of the fit alone, from residuals taken as white
    considered        (l, k)  change of `values` per unit of what was considered; k may be 0
    total_covariance  (l, l)  with what was considered
    identifiable      (l,)    whether the data see the parameter
    singular_values   (l,)    of the weighted, column-scaled problem, descending
    rank              how many of them count
    sigma             (n,)    residual RMS per joint, target's unit
    weights           (N, n)  of the last round, one over unit; zero where a row did not count
    correlation       (n,)    of the residual from sample to sample: near zero for noise
    optimism          robust over white standard deviation, median over parameters: near one for noise
    """

    values: Array
    covariance: Array
    considered: Array
    total_covariance: Array
    identifiable: NDArray[np.bool_]
    singular_values: Array
    rank: int
    sigma: Array
    weights: Array
    correlation: Array
    optimism: float

    @property
    def std(self) -> Array:
        """(l,) standard deviations with what was considered; infinite where unidentifiable."""
        spread = np.sqrt(np.maximum(np.diag(self.total_covariance), 0.0))
        return np.where(self.identifiable, spread, np.inf)

    @property
    def condition(self) -> float:
        """Of the part that counts."""
        return (
            float(self.singular_values[0] / self.singular_values[self.rank - 1])
            if self.rank
            else float("inf")
        )


def estimate(
    columns: Array,
    target: Array,
    options: FitOptions | None = None,
    consider: Consider | None = None,
    use: NDArray[np.bool_] | None = None,
) -> Estimate:
    """Solve target = columns @ values in the least squares that the options name.

    columns  (N, n, l), target (N, n): samples that may be taken as independent (filter.thinned)
    use      (N, n)  entries that count; None: all
    """
    options = options or FitOptions()
    use = np.ones(target.shape, dtype=bool) if use is None else use
    solved = _Solved(columns, target, use.astype(np.float64), options)
    for _ in range(0 if options.method == "ols" else options.rounds):
        weights = np.where(use, _weights(solved.residual, use, options), 0.0)
        solved = _Solved(columns, target, weights, options)
    return solved.estimate(consider)


def _weights(residual: Array, use: NDArray[np.bool_], options: FitOptions) -> Array:
    """(N, n) one over standard deviation, per joint; smaller for outliers with irls."""
    sigma = spread(residual, use)
    if options.method == "irls":
        size = np.nan_to_num(np.nanmedian(np.where(use, np.abs(residual), np.nan), axis=0))
        sigma = 1.4826 * size  # a normal law's deviation from its median size
    sigma = np.maximum(sigma, 1e-12 + 1e-9 * sigma.max(initial=0.0))
    if options.method == "wls":
        return np.broadcast_to(1.0 / sigma, residual.shape)
    size = np.maximum(np.abs(residual) / sigma, 1e-12)
    return np.asarray(np.sqrt(np.minimum(1.0, options.huber / size)) / sigma)


def spread(residual: Array, use: NDArray[np.bool_]) -> Array:
    """(n,) RMS of each joint's usable residuals; zero where it has none."""
    count = np.maximum(use.sum(axis=0), 1)
    return np.asarray(np.sqrt(np.sum(np.where(use, residual, 0.0) ** 2, axis=0) / count))


def sample_correlation(residual: Array, use: NDArray[np.bool_]) -> Array:
    """(n,) lag-one autocorrelation of each joint's usable residuals about zero."""
    both = use[1:] & use[:-1]
    product = np.sum(np.where(both, residual[1:] * residual[:-1], 0.0), axis=0)
    power = np.sum(np.where(both, 0.5 * (residual[1:] ** 2 + residual[:-1] ** 2), 0.0), axis=0)
    return np.asarray(np.divide(product, power, out=np.zeros_like(product), where=power > 0))


CORRELATED = 0.5
"""Correlation of neighbouring residuals above which they are called no noise: filtered white noise gives 0 +- 0.1."""


def noise_warnings(step: str, joint_names: Sequence[str], solved: Estimate) -> tuple[str, ...]:
    """Says so where residuals are no noise, for then the standard deviations are too small, and by how much at least."""
    found = [
        (name, rho) for name, rho in zip(joint_names, solved.correlation, strict=True) if rho > CORRELATED
    ]
    if not found and solved.optimism < OPTIMISTIC:
        return ()
    factors = [np.sqrt((1.0 + rho) / (1.0 - min(rho, 0.999))) for _, rho in found]
    factor = max([*factors, solved.optimism])
    where = ", ".join(f"{name} ({rho:.2f})" for name, rho in found) or "all joints together"
    return (
        f"{step}: the residual is no noise but correlated from sample to sample, joint(s) {where}: the model lacks an "
        f"effect there, and standard deviations are too small, by a factor of {factor:.1f} or more",
    )


OPTIMISTIC = 1.7
"""Robust over white standard deviation above which the latter is called too small."""


class _Solved:
    """One weighted solution by truncated SVD of the column-scaled rows."""

    def __init__(self, columns: Array, target: Array, weights: Array, options: FitOptions) -> None:
        self.options = options
        self.columns = columns
        self.weights = weights
        l = columns.shape[2]
        rows = (columns * weights[:, :, None]).reshape(-1, l)
        self.scale = np.linalg.norm(rows, axis=0)
        self.scale[self.scale < 1e-300] = 1.0
        self.left, self.singular, right = np.linalg.svd(rows / self.scale, full_matrices=False)
        self.right = right.T
        largest = self.singular[0] if len(self.singular) else 0.0
        self.rank = int(np.sum(self.singular > options.rank_tolerance * largest)) if largest > 0 else 0
        self.scaled = self.pseudo_inverse((target * weights).reshape(-1))
        unseen = np.ones(l) - np.sum(self.right[:, : self.rank] ** 2, axis=1)
        self.identifiable = unseen < options.unseen_share
        self.values = np.where(self.identifiable, self.scaled / self.scale, 0.0)
        self.residual = target - columns @ (self.scaled / self.scale)

    def pseudo_inverse(self, rows: Array) -> Array:
        kept = slice(0, self.rank)
        projected = self.left[:, kept].T @ rows
        inverse = 1.0 / self.singular[kept]
        solution: Array = self.right[:, kept] @ (
            inverse[:, None] * projected if rows.ndim == 2 else inverse * projected
        )
        return solution

    def estimate(self, consider: Consider | None) -> Estimate:
        l = self.columns.shape[2]
        kept = slice(0, self.rank)
        unit = self.right[:, kept] / self.singular[kept]
        freedom = max(int(np.count_nonzero(self.weights)) - self.rank, 1)
        weighted = self.residual * self.weights
        variance = float(np.sum(weighted**2)) / freedom
        fit = variance * unit @ unit.T
        considered = np.zeros((l, 0))
        total = fit
        if consider is not None and consider.columns.shape[2]:
            rows = (consider.columns * self.weights[:, :, None]).reshape(-1, consider.columns.shape[2])
            considered = -self.pseudo_inverse(rows)
            total = fit + considered @ consider.covariance @ considered.T
            considered = considered / self.scale[:, None]
        outer = np.outer(self.scale, self.scale)
        return Estimate(
            values=self.values,
            covariance=fit / outer,
            considered=considered,
            total_covariance=total / outer,
            identifiable=self.identifiable,
            singular_values=self.singular,
            rank=self.rank,
            sigma=spread(self.residual, self.weights > 0),
            weights=self.weights,
            correlation=sample_correlation(self.residual, self.weights > 0),
            optimism=self._optimism(np.diag(fit), weighted),
        )

    def _optimism(self, white: Array, weighted: Array) -> float:
        """Cluster-robust over white standard deviation (Liang and Zeger 1986): clusters are stretches of time."""
        count = min(self.options.clusters, len(weighted) // 4)
        if count < 5 or not self.rank:
            return 1.0
        l, n = self.columns.shape[2], self.columns.shape[1]
        kept = slice(0, self.rank)
        scores = self.left[:, kept] * weighted.reshape(-1, 1)
        cluster = np.repeat(np.arange(len(weighted)) * count // len(weighted), n)
        sums = np.zeros((count, self.rank))
        np.add.at(sums, cluster, scores)
        unit = self.right[:, kept] / self.singular[kept]
        robust = np.sum((sums @ unit.T) ** 2, axis=0) * count / (count - 1)
        seen = np.flatnonzero((white > 0) & self.identifiable[:l])
        return float(np.sqrt(np.median(robust[seen] / white[seen]))) if len(seen) else 1.0
