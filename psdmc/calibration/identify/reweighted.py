"""Standard deviations of a fit with Huber's weights, which reduce the effect of outliers.

The fit solves sum of psi(u) x = 0, where u is the residual in standard deviations, and psi(u) = u limited to plus or
minus a bound. Its covariance is B^-1 C B^-1 with B the sum of mean(psi') x x' and C the sum of mean(psi^2) x x' (Huber
1981, chapter 7). The formula of weighted least squares with w = psi(u) / u would use mean(w) and mean(w) mean(w u^2)
instead. Its standard deviations are 10 % too small for normal errors and a bound of 1.345.
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
    """Factors that convert the sums w x x' of a weighted fit to the matrices B and C of its covariance B^-1 C B^-1.

    Here x is a row of the fit, w its weight, psi Huber's function of the scaled residual u (see the module).

    slope  (n,) for each joint, the factor for B: mean(psi') / mean(w)
    level  (n,) for each joint, the factor for C: mean(psi^2) / mean(w), in squared units of the weighted residual
    unit   level / slope^2 for all joints together: the variance per unit of the fit's weighted sum of squares
    """

    slope: Array
    level: Array
    unit: float


def squares(n: int, variance: float) -> Sandwich:
    """Return the covariance factors of n joints for an ordinary least-squares fit, whose weighted residual has
    `variance`."""
    return Sandwich(np.ones(n), np.full(n, variance), variance)


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
