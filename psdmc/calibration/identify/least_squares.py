"""Linear least squares for all steps of the calibration. It weights joints and outliers, computes standard deviations,
and finds directions (combinations of unknowns) that the data do not determine.

Rows are read in blocks of samples, so no fit needs all of them in memory: few rows are kept there, more rows in a
temporary file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.estimate import Consider, Estimate, FitOptions, Prior
from psdmc.calibration.identify.residuals import (
    sample_correlation,
    spread,
    widening,
)
from psdmc.calibration.logs.log import Array, RowStore
from psdmc.calibration.logs.parts import in_threads


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Some of the samples of a linear least-squares problem, with N samples, n joints and l unknowns.

    columns   (N, n, l) torques per unit of each unknown
    noise     (N, n, l) columns that the sensors' noise alone would give; None: none
    consider  (N, n, k) columns of k quantities that are uncertain but not estimated (estimate.Consider); None: none
    """

    columns: Array
    noise: Array | None = None
    consider: Array | None = None

    def __len__(self) -> int:
        return len(self.columns)


class Rows(Protocol):
    """The blocks of samples of a linear least-squares problem, in order. They can be read repeatedly."""

    def __iter__(self) -> Iterator[Block]: ...


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """A weighted linear least-squares problem in triangular form. A (rows, l) are the weighted columns of l unknowns, y
    are the weighted targets, and `start` are values of the unknowns. R is triangular, with R'R = A'A.

    factor  (l, l) R
    onto    (l,)   R^-T A'(y - A start)
    noise   (l, l) N'N of the weighted noise columns N; None if there are none
    """

    factor: Array
    onto: Array
    noise: Array | None


def reduced(rows: Rows, target: Array, weights: Array, start: Array | None) -> Reduced:
    """Return a linear least-squares problem in triangular form. Only the rows of one block of samples and the
    triangular matrix are in memory at a time.

    target   (N samples, n joints) measured torques
    weights  (N, n) factors of the rows
    start    (l,) values of the unknowns, whose torques are subtracted from `target` first; None: zero
    """

    def of_block(numbered: tuple[Block, slice]) -> tuple[Array, Array | None]:
        block, own = numbered
        l, weight = block.columns.shape[2], weights[own]
        ahead = target[own] if start is None else target[own] - block.columns @ start
        flat = (block.columns * weight[:, :, None]).reshape(-1, l)
        together = np.column_stack([flat, (ahead * weight).reshape(-1)])
        triangle = _triangle(together)
        if block.noise is None:
            return triangle, None
        wrong = (block.noise * weight[:, :, None]).reshape(-1, l)
        return triangle, wrong.T @ wrong

    triangle, noise, l = np.zeros((0, 0)), None, 0
    wrong: Array | None
    for (block, _), (own, wrong) in in_threads(with_rows(rows), of_block):
        l = block.columns.shape[2]
        triangle = np.asarray(np.linalg.qr(np.vstack([triangle, own]), mode="r")) if len(triangle) else own
        noise = wrong if noise is None or wrong is None else noise + wrong
    whole = np.vstack([triangle, np.zeros((max(l - len(triangle), 0), l + 1))])
    return Reduced(whole[:l, :l], whole[:l, l], noise)


IN_CACHE = 2048
"""Rows of which LAPACK computes one QR decomposition. Twice as many rows leave the cache."""


def _triangle(rows: Array) -> Array:
    """R of the QR decomposition of many rows."""
    pieces = [np.linalg.qr(rows[k : k + IN_CACHE], mode="r") for k in range(0, len(rows), IN_CACHE)]
    return np.asarray(pieces[0] if len(pieces) == 1 else np.linalg.qr(np.vstack(pieces), mode="r"))


def residual_of(rows: Rows, target: Array, values: Array) -> Array:
    """Return the residual at all samples, an array (N samples, n joints): target minus columns @ values."""
    residual = np.empty_like(target)
    for block, own in with_rows(rows):
        residual[own] = target[own] - block.columns @ values
    return residual


@dataclass(frozen=True, slots=True, eq=False)
class Collected:
    """Sums over the weighted rows of a least-squares problem, from which standard deviations are computed. A are the
    weighted columns of l unknowns.

    squares   (n, l, l) A'A of the rows of each of n joints
    inner     (l, l)    A'A of the rows whose weighted residual is within a bound
    scores    (c, l)    A' times the weighted residual, for each of c periods of time
    consider  (l, k)    A' times the weighted columns of k results of earlier steps (Consider)
    """

    squares: Array
    inner: Array
    scores: Array
    consider: Array


def collected(rows: Rows, weights: Array, weighted: Array, clusters: int, bound: float = np.inf) -> Collected:
    """Return the sums over all rows of a least-squares problem from which standard deviations are computed.

    weights   (N samples, n joints) factors of the rows
    weighted  (N, n) residual times weights
    clusters  number of periods of time for which `scores` are summed; 0: none
    bound     size of `weighted` up to which a row counts in `inner`
    """
    count, n = weighted.shape
    squares, scores, consider = np.zeros((n, 0, 0)), np.zeros((clusters, 0)), np.zeros((0, 0))
    inner = np.zeros((0, 0))
    for block, own in with_rows(rows):
        flat = block.columns * weights[own][:, :, None]
        if not squares.shape[1]:
            l, k = flat.shape[2], 0 if block.consider is None else block.consider.shape[2]
            squares, scores, consider = np.zeros((n, l, l)), np.zeros((clusters, l)), np.zeros((l, k))
            inner = np.zeros((l, l))
        squares += np.stack([flat[:, j].T @ flat[:, j] for j in range(n)])
        within = flat[np.abs(weighted[own]) <= bound]
        inner += within.T @ within
        if clusters:
            stretch = np.arange(own.start, own.stop) * clusters // count
            np.add.at(scores, stretch, np.einsum("tnl,tn->tl", flat, weighted[own]))
        if block.consider is not None:
            consider += np.einsum("tnl,tnk->lk", flat, block.consider * weights[own][:, :, None])
    return Collected(squares, inner, scores, consider)


def with_rows(rows: Rows) -> Iterator[tuple[Block, slice]]:
    """Each block with its place among all samples."""
    start = 0
    for block in rows:
        yield block, slice(start, start + len(block))
        start += len(block)


BLOCK_SAMPLES = 2048
"""Samples that come as one block."""


class KeptRows:
    """Rows of a linear least-squares problem with n joints and l unknowns. They are appended once and read repeatedly.

    held  largest number of bytes in memory; more rows go to a temporary file
    """

    def __init__(self, n: int, l: int, held: int) -> None:
        self.shape = (n, l)
        self.columns, self.noise = RowStore(n * l, held // 2), RowStore(n * l, held // 2)

    def __len__(self) -> int:
        return len(self.columns)

    @property
    def on_disk(self) -> bool:
        return self.columns.on_disk

    def append(self, columns: Array, noise: Array) -> None:
        """Append k samples. `columns` (k, n joints, l unknowns) are torques per unit of each unknown. `noise` (k, n, l)
        are the columns that sensor noise alone would give."""
        for store, values in ((self.columns, columns), (self.noise, noise)):
            store.append(np.ascontiguousarray(values.reshape(len(values), -1)))

    def __iter__(self) -> Iterator[Block]:
        return iter(self.between(0, len(self)))

    def between(self, first: int, end: int) -> Rows:
        """Return the rows of the samples from `first` to before `end`, which are read when they are needed."""
        return _Between(self, first, end)


@dataclass(frozen=True, slots=True)
class _Between:
    """Some consecutive samples of kept rows."""

    rows: KeptRows
    first: int
    end: int

    def __iter__(self) -> Iterator[Block]:
        for start in range(self.first, self.end, BLOCK_SAMPLES):
            stop = min(start + BLOCK_SAMPLES, self.end)
            shape = (stop - start, *self.rows.shape)
            yield Block(
                self.rows.columns.rows(start, stop).reshape(shape),
                self.rows.noise.rows(start, stop).reshape(shape),
            )


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
    plain = options.method == "ols"
    for _ in range(1 if plain else options.rounds):
        weights = (
            use.astype(np.float64) if plain else np.where(use, _weights(solved.residual, use, options), 0.0)
        )
        weighted = np.where(use, solved.residual * weights, 0.0)
        level = float(np.sqrt(np.sum(weighted**2) / max(int(use.sum()), 1)))
        solved = _Solved(rows, target, weights, options, prior, level)
    return solved.estimate(considered)


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


# Standard deviations of a fit with Huber's weights
#
# Huber's weights reduce the effect of outliers. The fit solves sum of psi(u) x = 0, where u is the residual in standard
# deviations, and psi(u) = u limited to plus or minus a bound. Its covariance is B^-1 C B^-1 with B the sum of
# mean(psi') x x' and C the sum of mean(psi^2) x x' (Huber 1981, chapter 7). The formula of weighted least squares with
# w = psi(u) / u would use mean(w) and mean(w) mean(w u^2) instead. Its standard deviations are 10 % too small for normal
# errors and a bound of 1.345.


LEAST_SLOPE = 0.5
"""Of mean(psi'): standard deviations are taken from the median size of the residual, so that half of it, and more, lies
below the bound. Less is left from a round whose residual was another one."""


@dataclass(frozen=True, slots=True, eq=False)
class Sandwich:
    """Factors that convert the sums w x x' of a weighted fit to the matrices B and C of its covariance B^-1 C B^-1.

    Here x is a row of the fit, w its weight, psi Huber's function of the scaled residual u.

    slope  (n,) for each joint, the factor for B: mean(psi') / mean(w)
    level  (n,) for each joint, the factor for C: mean(psi^2) / mean(w), in squared units of the weighted residual
    unit   level / slope^2 for all joints together: the variance per unit of the fit's weighted sum of squares
    """

    slope: Array
    level: Array
    unit: float


def huber_sandwich(weighted: Array, use: NDArray[np.bool_], bound: float, share: float) -> Sandwich:
    """Return the factors that change the covariance of least squares into that of a fit with Huber's weights.

    Huber's weights reduce the effect of outliers. Each of the n joints (columns of `weighted`) has one factor for the
    matrix B and one for the matrix C of the covariance B^-1 C B^-1 (see the class Sandwich). One more factor, `unit`,
    is for all joints together. It multiplies the inverse of the sum of w x x' over the fit's rows x with weights w.

    weighted  (N, n) sqrt(w) u: residuals u in standard deviations times the root of their weights w
    use       (N, n) True: the sample is used
    bound     limit of u above which Huber's weights are below one
    share     degrees of freedom divided by the number of samples; a smaller share gives a larger covariance
    """
    each = [_factors(weighted[use[:, k], k], bound, share) for k in range(weighted.shape[1])]
    slope, level = np.array(each).T
    together = _factors(weighted[use], bound, share)
    return Sandwich(slope, level, together[1] / together[0] ** 2)


def _factors(weighted: Array, bound: float, share: float) -> tuple[float, float]:
    """Slope and level of some entries; of none, one and zero."""
    if not len(weighted):
        return 1.0, 0.0
    size = np.abs(weighted)
    # beyond the bound w = bound / |u|, and the weighted residual is sqrt(bound |u|)
    weight = float(np.mean((bound / np.maximum(size, bound)) ** 2))
    slope = max(float(np.mean(size <= bound)), LEAST_SLOPE)
    return slope / weight, float(np.mean(np.minimum(size, bound) ** 2)) / weight / share


# The solution


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
        clusters = min(self.options.clusters, len(weighted) // 4)
        if clusters < FEWEST_CLUSTERS or not self.rank:
            clusters = 0  # too few rows for robust standard deviations
        sums = collected(self.rows, self.weights, weighted, clusters, bound)
        sandwich = self._sandwich(weighted, use)
        by_scores = self._by_scores(sandwich, sums.squares)
        white = by_scores @ np.tensordot(sandwich.level, sums.squares, axes=1) @ by_scores.T
        level = sandwich.level * widening(weighted, use) ** 2
        fit = by_scores @ np.tensordot(level, sums.squares, axes=1) @ by_scores.T
        optimism = self._optimism(np.diag(fit), sums.scores @ self._by_inner(sums.inner))
        common = max(float(np.median(optimism[self.identifiable])), 1.0) if self.identifiable.any() else 1.0
        widened, of_noise = common**2 * np.diag(fit), np.diag(white)
        seen = np.flatnonzero((of_noise > 0) & self.identifiable)
        factor = float(np.sqrt(np.max(widened[seen] / of_noise[seen]))) if len(seen) else 1.0
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
        n, variance = weighted.shape[1], float(np.sum(weighted**2)) / freedom
        return Sandwich(np.ones(n), np.full(n, variance), variance)

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

    def _optimism(self, widened: Array, moved: Array) -> Array:
        """(l,) cluster-robust over widened standard deviation (Liang and Zeger 1986): clusters are stretches of time.
        One where it is unknown. moved (c, l) is what each stretch's score does to the values."""
        count = len(moved)
        robust = np.sum(moved**2, axis=0) * count / max(count - 1, 1)
        known = (widened > 0) & self.identifiable & (count > 0)
        return np.asarray(np.sqrt(np.divide(robust, widened, out=np.ones(len(widened)), where=known)))


FEWEST_CLUSTERS = 5
"""Least number of stretches of time from which a standard deviation can be computed."""
