"""Inputs and results of a linear least-squares fit: its options, values before the fit (the prior), and the estimate
with its covariance.

In this module, a direction is a linear combination of the unknowns. A direction is seen if the data determine it. In an
unseen direction, the estimate keeps the value of the prior.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.identify.predictor import Regressor
from psdmc.calibration.logs.log import Array
from psdmc.robot.mechanism import Mechanism

Method = Literal["ols", "wls", "irls"]


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How a linear least-squares problem is solved. A direction is a linear combination of the unknowns; it is seen if
    the data determine it.

    method          ols: equal weights; wls: each joint is weighted by its residual; irls: like wls, with less weight
                    for outliers (Huber)
    rounds          number of times that the weights are computed again
    huber           residual in standard deviations above which irls uses magnitudes instead of squares: 1.345 keeps 95
                    % of least squares' efficiency for normal errors
    rank_tolerance  relative error of a column in addition to its noise: differentiation and filters cause about 1e-4
    noise_ratio     how many times stronger than the noise of its columns a seen direction is at least. With ten, this
                    noise reduces the result by a tenth at most
    seen            standard deviation above which a direction is not seen, in units of a plausible size of the unknowns
    unseen_share    share of an unknown that lies in unseen directions, above which the unknown is unidentifiable. The
                    share is squared, in units of a plausible size
    clusters        number of periods of time, within which errors may depend on one another, for the standard
                    deviations
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
    """k results of an earlier step, such as torque constants, that this step uses. Their uncertainty adds to that of
    this step, but they are not estimated again.

    columns     (N samples, n joints, k) change of (prediction - target) per unit of each result
    covariance  (k, k) of the results
    """

    columns: Array
    covariance: Array


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """The values of the l unknowns before a fit. They remain in directions (linear combinations of unknowns) that the
    data do not determine.

    values  (l,) the parameters of the robot file, or zero
    scale   (l,) positive: a plausible difference between an unknown and its value here, the unit of distances
    noise   (N samples, n joints, l) columns that the sensors' noise alone would give; None if the states are exact
    """

    values: Array
    scale: Array
    noise: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The solution of target = columns @ values, for l unknowns and n joints. A direction is a linear combination of
    the unknowns; the data determine r directions, which are called seen. N is the number of samples.

    values            (l,)      from the data in seen directions, from the prior in the others
    covariance        (l, l)    of the fit alone, larger if residuals are correlated; zero in unseen directions
    considered        (l, k)    change of `values` per unit of k results of earlier steps (Consider); k may be 0
    total_covariance  (l, l)    includes the uncertainty of the results of earlier steps
    unseen            (l, l - r)  orthonormal directions that the data do not determine, in units of `scale`
    scale             (l,)      plausible size of each unknown, from the prior or, if there is none, from the columns
    prior_std         standard deviation of unseen directions, in units of `scale`; zero without a prior
    whitening         (l, l)    W with |W (v - values)|^2 the cost of any values v, in variances. In seen directions it
                                comes from the data (their sum of squares over noise_factor^2), in the others from the
                                prior
    identifiable      (l,)      whether the data determine the unknown by itself
    singular_values   (l,)      of the weighted problem with scaled columns, descending
    rank              number r of seen directions
    sigma             (n,)      residual RMS per joint, in the unit of the target
    weights           (N, n)    of the last round, one over unit; zero for rows that were not used
    correlation       (n,)      of the residual from sample to sample: near zero for noise
    noise_factor      largest factor by which correlated residuals increased a standard deviation; near one for noise.
                      A further increase, which an unknown gets alone, does not count
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
        """Return the covariance (l, l) of the l unknowns that comes from the prior, in directions (linear combinations)
        that the data do not determine."""
        directions = self.scale[:, None] * self.unseen
        return np.asarray(self.prior_std**2 * directions @ directions.T)

    @property
    def std(self) -> Array:
        """Return the standard deviations (l,) of the l unknowns. They include the uncertainty of results of earlier
        steps. In directions that the data do not determine, they include that of the prior. The standard deviation of
        an unidentifiable unknown is infinite."""
        variance = np.diag(self.total_covariance) + np.diag(self.prior_covariance)
        return np.where(self.identifiable, np.sqrt(np.maximum(variance, 0.0)), np.inf)

    @property
    def condition(self) -> float:
        """Return the condition number of the least-squares problem with scaled columns. It counts only directions
        (linear combinations of unknowns) that the data determine."""
        return (
            float(self.singular_values[0] / self.singular_values[self.rank - 1])
            if self.rank
            else float("inf")
        )


# Plausible sizes before a fit


STATES = 200
SEED = 51_407
ORDINARY_SPEED = 1.0
"""rad/s, m/s: an ordinary speed of a robot."""
ORDINARY_ACCELERATION = 5.0
"""rad/s^2, m/s^2: an ordinary acceleration."""
QUIET_JOINT = 0.02
"""Least share of the largest joint torque that every joint gets as its size: one that carries nothing shows only noise."""
NO_EFFECT = 1e-9
"""Share of a column's largest entry below which the parameter has no effect on a joint."""


def torque_sizes(torque: Array) -> Array:
    """Return a typical torque (n,) of each joint: the RMS of its torques (N, n), N m.

    The result for a joint is at least the share QUIET_JOINT of the largest RMS of all joints.
    """
    size = np.sqrt(np.mean(torque**2, axis=0))
    return np.asarray(np.maximum(size, QUIET_JOINT * float(size.max(initial=0.0)) or 1.0))


def base_parameter_scale(chain: Mechanism, model: Regressor, sizes: Array, theta_b: Array | None) -> Array:
    """Return a plausible size (l,) of each base parameter, as a scale for priors.

    This is the value with which the parameter alone explains the typical torque of a joint in an ordinary motion.

    sizes    (n,) N m, typical torques of the joints
    theta_b  (l,) base parameters of the robot file, which are plausible sizes, too; None: the file gives none
    """
    rng = np.random.default_rng(SEED)
    n = chain.nv
    q = rng.uniform(-np.pi, np.pi, (STATES, n))
    qd = rng.uniform(-ORDINARY_SPEED, ORDINARY_SPEED, (STATES, n))
    qdd = rng.uniform(-ORDINARY_ACCELERATION, ORDINARY_ACCELERATION, (STATES, n))
    effect = np.sqrt(np.mean(model.regressor(q, qd, qdd) ** 2, axis=0))
    acts = effect > NO_EFFECT * effect.max(axis=0, initial=0.0)
    scale = np.min(np.where(acts, sizes[:, None] / np.where(acts, effect, 1.0), np.inf), axis=0)
    scale = np.where(np.isfinite(scale), scale, 1.0)
    return scale if theta_b is None else np.maximum(scale, np.abs(theta_b))
