"""Linear least squares for all steps of the calibration. It weights joints and outliers, computes standard deviations,
and finds directions (combinations of unknowns) that the data do not determine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import Consider, Estimate, FitOptions, Prior
from psdmc.calibration.identify.linear_rows import Block, Rows, collected, reduced, residual_of
from psdmc.calibration.identify.residuals import (
    Sandwich,
    huber_sandwich,
    sample_correlation,
    spread,
    squares,
    widening,
)
from psdmc.calibration.logs.log import Array


def estimate(
    columns: Array,
    target: Array,
    options: FitOptions | None = None,
    consider: Consider | None = None,
    use: NDArray[np.bool_] | None = None,
    prior: Prior | None = None,
) -> Estimate:
    """Return the least-squares solution of target = columns @ values for l unknown values.

    columns  (N, n, l) torques of n joints per unit of each unknown, at N samples that count as independent
             (filter.thinned)
    target   (N, n) measured torques
    use      (N, n) whether an entry is used; None: all are
    prior    values before the fit, with a plausible size of each; None: zero, and sizes follow from the columns
    """
    noise = None if prior is None else prior.noise
    rows = [Block(columns, noise, None if consider is None else consider.columns)]
    return estimate_rows(rows, target, options, None if consider is None else consider.covariance, use, prior)


def estimate_rows(
    rows: Rows,
    target: Array,
    options: FitOptions | None = None,
    considered: Array | None = None,
    use: NDArray[np.bool_] | None = None,
    prior: Prior | None = None,
) -> Estimate:
    """Return the least-squares solution of target = columns @ values, for columns that are read in blocks of samples.
    So not all blocks have to be in memory at once.

    rows        the blocks, with their noise columns
    target      (N samples, n joints) measured torques
    considered  (k, k) covariance of k results of earlier steps, on which the blocks' `consider` columns depend
    use         (N, n) whether an entry is used; None: all are
    prior       values before the fit, with a plausible size of each; the noise columns are in the blocks
    """
    options = options or FitOptions()
    use = np.ones(target.shape, dtype=bool) if use is None else use
    solved = _Solved(rows, target, use.astype(np.float64), options, prior, 0.0)
    for _ in range(1 if options.method == "ols" else options.rounds):
        plain = options.method == "ols"
        weights = (
            use.astype(np.float64) if plain else np.where(use, _weights(solved.residual, use, options), 0.0)
        )
        solved = _Solved(rows, target, weights, options, prior, _level(solved.residual * weights, use))
    return solved.estimate(considered)


def _level(weighted: Array, use: NDArray[np.bool_]) -> float:
    """RMS of a weighted residual's usable entries."""
    return float(np.sqrt(np.sum(np.where(use, weighted, 0.0) ** 2) / max(int(use.sum()), 1)))


def _weights(residual: Array, use: NDArray[np.bool_], options: FitOptions) -> Array:
    """(N, n) weights: one over standard deviation, per joint; smaller for outliers with irls."""
    sigma = spread(residual, use)
    if options.method == "irls":
        size = np.nan_to_num(np.nanmedian(np.where(use, np.abs(residual), np.nan), axis=0))
        sigma = 1.4826 * size  # a normal law's deviation from its median size
    sigma = np.maximum(sigma, 1e-12 + 1e-9 * sigma.max(initial=0.0))
    if options.method == "wls":
        return np.broadcast_to(1.0 / sigma, residual.shape)
    size = np.maximum(np.abs(residual) / sigma, 1e-12)
    return np.asarray(np.sqrt(np.minimum(1.0, options.huber / size)) / sigma)


NUMERICAL = 1e-9
"""Relative to the largest column: the size of a column that is rounding alone."""

ROUNDING = 1e-12
"""Share of a parameter in seen directions that counts as none: its value is then exactly the prior's."""


class _Solved:
    """One weighted solution, in units z of the prior: v = v0 + S z.

    Directions in which the data are stronger than `_floor` are shown, the others hidden. Hidden ones form a subspace,
    in which z = 0; the rest of z is the least-squares solution.
    """

    def __init__(
        self,
        rows: Rows,
        target: Array,
        weights: Array,
        options: FitOptions,
        prior: Prior | None,
        level: float,
    ) -> None:
        self.options = options
        self.rows = rows
        self.weights = weights
        found = reduced(rows, target, weights, None if prior is None else prior.values)
        factor, l = found.factor, found.factor.shape[1]
        sizes = np.linalg.norm(factor, axis=0)
        unit = np.where(sizes > 0, sizes, 1.0)
        self.column_values = np.asarray(np.linalg.svd(factor / unit, compute_uv=False), dtype=np.float64)
        start = np.zeros(l) if prior is None else prior.values
        scale = 1.0 / unit if prior is None else prior.scale
        noise = None if prior is None else found.noise
        chol = np.linalg.cholesky(self._floor(sizes * scale, scale, noise, 0.0 if prior is None else level))
        by_prior = factor * scale
        _, strength, right = np.linalg.svd(by_prior @ np.linalg.inv(chol).T)
        self.rank = int(np.sum(strength > 1.0))
        hidden = np.linalg.inv(chol).T @ right[self.rank :].T
        basis = np.linalg.qr(hidden, mode="complete")[0]
        self.unseen, shown = basis[:, : l - self.rank], basis[:, l - self.rank :]
        self.scale = scale
        self.prior_std = 0.0 if prior is None else options.seen
        _, self.singular, turned = np.linalg.svd(by_prior @ shown, full_matrices=False)
        self.inverse = scale[:, None] * (shown @ turned.T) / self.singular
        self.forth = self.singular[:, None] * (turned @ shown.T) / scale
        coordinates = (factor @ self.inverse).T @ found.onto
        share = np.sum(self.unseen**2, axis=1)
        self.values = np.where(share > 1.0 - ROUNDING, start, start + self.inverse @ coordinates)
        self.residual = residual_of(rows, target, self.values)
        self.identifiable = share < options.unseen_share

    def _floor(self, sizes: Array, scale: Array, noise: Array | None, level: float) -> Array:
        """(l, l), in the prior's units: the square of what a direction must exceed to be seen.

        It includes noise in the columns, times the ratio that the options ask for; the error of differentiation, a
        share of each column; and the torque's noise, relative to the prior's scale.
        """
        options = self.options
        largest = float(sizes.max(initial=0.0)) or 1.0
        floor = np.diag(
            (options.rank_tolerance * sizes) ** 2 + max(level / options.seen, NUMERICAL * largest) ** 2
        )
        return (
            floor
            if noise is None
            else np.asarray(floor + options.noise_ratio * np.outer(scale, scale) * noise)
        )

    def estimate(self, covariance: Array | None) -> Estimate:
        """Return the solution of the least-squares problem with its covariance.

        covariance  (k, k) of the k results of earlier steps (Consider); None if there are none
        """
        l, use = len(self.values), self.weights > 0
        weighted = self.residual * self.weights
        bound = self.options.huber if self.options.method == "irls" else np.inf
        sums = collected(self.rows, self.weights, weighted, self._clusters(len(weighted)), bound)
        sandwich = self._sandwich(weighted, use)
        by_scores = self._by_scores(sandwich, sums.squares)
        white = by_scores @ np.tensordot(sandwich.level, sums.squares, axes=1) @ by_scores.T
        level = sandwich.level * widening(weighted, use) ** 2
        fit = by_scores @ np.tensordot(level, sums.squares, axes=1) @ by_scores.T
        optimism = self._optimism(np.diag(fit), sums.scores @ self._by_inner(sums.inner))
        common = max(float(np.median(optimism[self.identifiable])), 1.0) if self.identifiable.any() else 1.0
        factor = self._noise_factor(common**2 * np.diag(fit), np.diag(white))
        # a variance of c stretches has the relative standard error sqrt(2 / (c - 1))
        beyond = 1.0 + 2.0 * np.sqrt(2.0 / max(len(sums.scores) - 1, 1))
        own = np.where(optimism**2 > beyond * common**2, optimism, common)
        fit *= np.outer(own, own)
        considered, total = np.zeros((l, 0)), fit
        if covariance is not None and sums.consider.shape[1]:
            considered = -self.inverse @ (self.inverse.T @ sums.consider)
            total = fit + considered @ covariance @ considered.T
        unit = np.sqrt(sandwich.unit) or 1.0
        by_prior = self.unseen.T / self.scale / self.options.seen
        return Estimate(
            values=self.values,
            covariance=fit,
            considered=considered,
            total_covariance=total,
            unseen=self.unseen,
            scale=self.scale,
            prior_std=self.prior_std,
            whitening=np.vstack([self.forth / (unit * factor), by_prior]),
            identifiable=self.identifiable,
            singular_values=self.column_values,
            rank=self.rank,
            sigma=spread(self.residual, use),
            weights=self.weights,
            correlation=sample_correlation(self.residual, use),
            noise_factor=factor,
        )

    def _sandwich(self, weighted: Array, use: NDArray[np.bool_]) -> Sandwich:
        """How sizes and slopes of the weighted residual enter the covariance."""
        count = max(int(np.count_nonzero(use)), 1)
        freedom = max(count - self.rank, 1)
        if self.options.method == "irls":
            return huber_sandwich(weighted, use, self.options.huber, freedom / count)
        return squares(weighted.shape[1], float(np.sum(weighted**2)) / freedom)

    def _by_scores(self, sandwich: Sandwich, own: Array) -> Array:
        """(l, l) change of the values per unit of the score A' r; own (n, l, l) are the joints' squares A'A."""
        slopes = np.tensordot(sandwich.slope, own, axes=1)
        return np.asarray(
            self.inverse @ np.linalg.solve(self.inverse.T @ slopes @ self.inverse, self.inverse.T)
        )

    def _by_inner(self, inner: Array) -> Array:
        """Return the change (l, l) of the values per unit of the score, for errors that depend on the columns. It is the
        inverse of A'A of the rows whose psi' is one, not of the mean of psi' (Huber and Ronchetti 2009, chapter 7)."""
        by_seen = np.linalg.pinv(self.inverse.T @ inner @ self.inverse, hermitian=True)
        return np.asarray(self.inverse @ by_seen @ self.inverse.T)

    def _noise_factor(self, widened: Array, white: Array) -> float:
        """The largest ratio of a standard deviation to that for white residuals."""
        seen = np.flatnonzero((white > 0) & self.identifiable)
        return float(np.sqrt(np.max(widened[seen] / white[seen]))) if len(seen) else 1.0

    def _clusters(self, count: int) -> int:
        """Number of stretches of time for robust standard deviations; 0 where there are too few rows."""
        clusters = min(self.options.clusters, count // 4)
        return clusters if clusters >= FEWEST_CLUSTERS and self.rank else 0

    def _optimism(self, widened: Array, moved: Array) -> Array:
        """(l,) cluster-robust over widened standard deviation (Liang and Zeger 1986): clusters are stretches of time.
        One where it is unknown. moved (c, l) is what each stretch's score does to the values."""
        count = len(moved)
        robust = np.sum(moved**2, axis=0) * count / max(count - 1, 1)
        known = (widened > 0) & self.identifiable & (count > 0)
        return np.asarray(np.sqrt(np.divide(robust, widened, out=np.ones(len(widened)), where=known)))


FEWEST_CLUSTERS = 5
"""Least number of stretches of time from which a standard deviation can be computed."""
