"""Inputs and results of a linear fit: its options, its prior, and the estimate with its covariance.

A direction is a linear combination of unknowns; the data show it (it is seen) or not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.log import Array

Method = Literal["ols", "wls", "irls"]


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How a linear problem is solved.

    method          ols: equal weights; wls: each joint is weighted by its residual; irls: like wls, with less weight for
                    outliers (Huber)
    rounds          number of reweightings
    huber           residual in standard deviations beyond which irls uses magnitudes instead of squares: 1.345 keeps
                    95 % of least squares' efficiency for normal errors
    rank_tolerance  relative error of a column in addition to its noise: differentiation and filters cause about 1e-4
    noise_ratio     how many times stronger than noise a direction must be: with ten, noise in the columns reduces
                    the result by a tenth at most
    seen            standard deviation, in units of the prior's scale, above which a direction is not seen
    unseen_share    share (squared, in the prior's units) of a parameter in unseen directions above which it is
                    unidentifiable
    clusters        number of periods of time with dependent errors, for the robust standard deviations
    """

    method: Method = "wls"
    rounds: int = 6
    huber: float = 1.345
    rank_tolerance: float = 3e-4
    noise_ratio: float = 10.0
    seen: float = 0.2
    unseen_share: float = 1e-2
    clusters: int = 30


@dataclass(frozen=True, slots=True, eq=False)
class Consider:
    """Uncertain results of an earlier step that this step uses. They add to its uncertainty but are not estimated
    again.

    columns     (N, n, k)  change of (prediction - target) per unit of each quantity
    covariance  (k, k)     of these quantities
    """

    columns: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Values before the fit. They remain in directions that the data do not show. `scale` gives the unit of distances
    from them.

    values  (l,)       the file's parameters, or zero
    scale   (l,)       positive: a plausible distance between a parameter and its value here
    noise   (N, n, l)  columns that the sensors' noise alone would give; None if states are exact
    """

    values: Array
    scale: Array
    noise: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The solution of target = columns @ values, with l unknowns, n joints and r directions that the data show.

    values            (l,)      from the data in seen directions, from the prior in the others
    covariance        (l, l)    of the fit alone, larger if residuals are correlated; zero in unseen directions
    considered        (l, k)    change of `values` per unit of the quantities in Consider; k may be 0
    total_covariance  (l, l)    includes the uncertainty of these quantities
    unseen            (l, l - r)  orthonormal directions that the data do not show, in units of `scale`
    scale             (l,)      the prior's, or the columns' if there is no prior
    prior_std         standard deviation of unseen directions, in units of `scale`; zero without a prior
    whitening         (l, l)    W with |W (v - values)|^2 the cost of any v, in variances. In seen directions it comes from
                                the data (their sum of squares over noise_factor^2), in the others from the prior
    identifiable      (l,)      whether the data determine the parameter by itself
    singular_values   (l,)      of the weighted problem with scaled columns, descending
    rank              number of seen directions
    sigma             (n,)      residual RMS per joint, in the unit of the target
    weights           (N, n)    of the last round, one over unit; zero for rows that were not used
    correlation       (n,)      of the residual from sample to sample: near zero for noise
    noise_factor      largest factor by which correlated residuals increased a standard deviation; near one for noise
    """

    values: Array
    covariance: Array
    considered: Array
    total_covariance: Array
    unseen: Array
    scale: Array
    prior_std: float
    whitening: Array
    identifiable: NDArray[np.bool_]
    singular_values: Array
    rank: int
    sigma: Array
    weights: Array
    correlation: Array
    noise_factor: float

    @property
    def prior_covariance(self) -> Array:
        """Covariance (l, l) of the prior in directions that the data do not show."""
        directions = self.scale[:, None] * self.unseen
        return np.asarray(self.prior_std**2 * directions @ directions.T)

    @property
    def std(self) -> Array:
        """Standard deviations (l,), with the uncertainty of earlier steps, and of the prior in unseen directions. They
        are infinite for unidentifiable parameters."""
        variance = np.diag(self.total_covariance) + np.diag(self.prior_covariance)
        return np.where(self.identifiable, np.sqrt(np.maximum(variance, 0.0)), np.inf)

    @property
    def condition(self) -> float:
        """Condition number of the fit in the directions that the data show, with scaled columns."""
        return (
            float(self.singular_values[0] / self.singular_values[self.rank - 1])
            if self.rank
            else float("inf")
        )
