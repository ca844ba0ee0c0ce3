"""What Huber's weights do to the standard deviations of a reweighted fit.

Such a fit solves sum of psi(u) x = 0 with u the residual in standard deviations, psi(u) = u up to a bound and the bound
beyond. Its covariance is B^-1 C B^-1 with B the sum of mean(psi') x x' and C the sum of mean(psi^2) x x' (Huber 1981,
chapter 7). Weighted least squares with w = psi(u) / u would put mean(w) for the one and mean(w) mean(w u^2) for the
other: 10 % too little for normal errors and a bound of 1.345.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.log import Array

LEAST_SLOPE = 0.5
"""Of mean(psi'): standard deviations are taken from the median size of the residual, so that half of it, and more, lies
below the bound. Less is left from a round whose residual was another one."""


@dataclass(frozen=True, slots=True, eq=False)
class Sandwich:
    """Factors of the rows' own squares w x x', joint by joint.

    slope  (n,)  B's: mean(psi') / mean(w)
    level  (n,)  C's: mean(psi^2) / mean(w), in the weighted residual's unit, squared
    unit   what the fit's weighted sum of squares is worth in variances, all joints together: level / slope^2
    """

    slope: Array
    level: Array
    unit: float


def squares(n: int, variance: float) -> Sandwich:
    """Of a fit without reweighting, whose weighted residual has this variance."""
    return Sandwich(np.ones(n), np.full(n, variance), variance)


def huber_sandwich(weighted: Array, use: NDArray[np.bool_], bound: float, share: float) -> Sandwich:
    """Of Huber's weights.

    weighted  (N, n)  sqrt(w) u
    use       (N, n)  entries that count
    share     of the samples that are left beside the unknowns: small samples are enlarged by as much
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
