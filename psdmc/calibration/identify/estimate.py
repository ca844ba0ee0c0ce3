"""What a linear fit is given and gives: its options, what is known before, and the estimate with its covariance."""

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

    method          ols: all rows alike; wls: each joint by its own residual; irls: wls, and outliers count less (Huber)
    rounds          of reweighting
    huber           residual in standard deviations beyond which irls turns from squares to magnitudes: 1.345 keeps
                    95 % of least squares' efficiency where errors are normal
    rank_tolerance  share of its own size by which a column may be wrong, besides its noise: differentiation and filters
                    leave about 1e-4
    noise_ratio     how many times stronger than noise alone a direction must be: at ten, noise in the columns shrinks
                    the result by a tenth at most
    seen            standard deviation, in units of the prior's scale, from which the data no longer show a direction
    unseen_share    share (squared, in the prior's units) of a parameter in unseen directions from which it is
                    unidentifiable
    clusters        contiguous stretches whose errors may be dependent, for the robust standard deviations
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
    """Quantities that an earlier step left uncertain and this one uses: their effect is counted, not estimated.

    columns     (N, n, k)  change of (prediction - target) per unit of each quantity
    covariance  (k, k)
    """

    columns: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """The values before the data are seen: kept in unseen directions, with the units that measure distances from them.

    values  (l,)       the file's parameters, or zero
    scale   (l,)       positive: how far from them a parameter may believably lie
    noise   (N, n, l)  columns that the sensors' noise alone would give; None where states are exact
    """

    values: Array
    scale: Array
    noise: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The solution of target = columns @ values. l unknowns, n joints, r directions seen.

    values            (l,)      by the data in seen directions; the prior's in unseen ones
    covariance        (l, l)    of the fit alone, widened where residuals are correlated; none in unseen directions
    considered        (l, k)    change of `values` per unit of what was considered; k may be 0
    total_covariance  (l, l)    with what was considered
    unseen            (l, l - r)  orthonormal directions that the data do not show, in units of `scale`
    scale             (l,)      the prior's, or the columns' where there is none
    prior_std         of unseen directions, in units of `scale`; zero without a prior
    whitening         (l, l)    W with |W (v - values)|^2 the cost of any v, in variances: the data's in seen directions
                                (its sum of squares over noise_factor^2), the prior's in others
    identifiable      (l,)      whether the data see the parameter by itself
    singular_values   (l,)      of the weighted, column-scaled problem, descending
    rank              how many directions are seen
    sigma             (n,)      residual RMS per joint, target's unit
    weights           (N, n)    of the last round, one over unit; zero where a row did not count
    correlation       (n,)      of the residual from sample to sample: near zero for noise
    noise_factor      largest factor by which correlated residuals widened a standard deviation; near one for noise
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
        """(l, l) covariance of the prior in directions that the data do not show."""
        directions = self.scale[:, None] * self.unseen
        return np.asarray(self.prior_std**2 * directions @ directions.T)

    @property
    def std(self) -> Array:
        """(l,) standard deviations with what was considered and the prior's in unseen directions; infinite where
        unidentifiable."""
        variance = np.diag(self.total_covariance) + np.diag(self.prior_covariance)
        return np.where(self.identifiable, np.sqrt(np.maximum(variance, 0.0)), np.inf)

    @property
    def condition(self) -> float:
        """Condition number of the seen part, columns scaled."""
        return (
            float(self.singular_values[0] / self.singular_values[self.rank - 1])
            if self.rank
            else float("inf")
        )
