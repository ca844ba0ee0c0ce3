"""Statistics of a fit's residuals: R^2 and RMSE, whether they are noise, and to how many independent samples they
correspond."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from psdmc.calibration.identify.estimate import Estimate
from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import Quality, Remark


def quality(measured: Array, predicted: Array) -> Quality:
    """Return R^2 and root mean square error of one joint's predicted torque, from N samples each of `measured` and
    `predicted`.

    R^2 is one minus the ratio of the mean squared error to the variance of the measured torque.
    """
    if len(measured) == 0:
        return Quality(float("nan"), float("nan"))
    error = float(np.mean((measured - predicted) ** 2))
    spread = float(np.var(measured))
    return Quality(float(np.sqrt(error)), 1.0 - error / spread if spread > 0 else float("nan"))


def qualities(measured: Array, predicted: Array) -> tuple[Quality, ...]:
    """Return R^2 and RMSE of each joint's predicted torque, from measured and predicted torques (N, n)."""
    return tuple(quality(measured[:, k], predicted[:, k]) for k in range(measured.shape[1]))


def spread(residual: Array, use: NDArray[np.bool_]) -> Array:
    """Return the RMS (n,) of each joint's usable residuals; zero for a joint without any."""
    count = np.maximum(use.sum(axis=0), 1)
    return np.asarray(np.sqrt(np.sum(np.where(use, residual, 0.0) ** 2, axis=0) / count))


def sample_correlation(residual: Array, use: NDArray[np.bool_]) -> Array:
    """Return the lag-one autocorrelation (n,) of each joint's usable residuals about zero."""
    both = use[1:] & use[:-1]
    product = np.sum(np.where(both, residual[1:] * residual[:-1], 0.0), axis=0)
    power = np.sum(np.where(both, 0.5 * (residual[1:] ** 2 + residual[:-1] ** 2), 0.0), axis=0)
    return np.asarray(np.divide(product, power, out=np.zeros_like(product), where=power > 0))


SURELY = 0.999
"""Largest correlation that is used: where it is closer to one, the log is too short."""
FEWEST_PAIRS = 20
"""Pairs of samples below which a lag's correlation is not computed."""


def widening(residual: Array, use: NDArray[np.bool_]) -> Array:
    """Return the factor (n,), at least 1, by which correlated residuals increase standard deviations, for n joints.

    The factor is the square root of the number of correlated samples that count as one independent sample. Two
    estimates of this number are computed, and the larger one is used. An autoregressive process with lag-one
    correlation r has (1 + r) / (1 - r). Any stationary process has 1 + 2 times the sum of its correlations. They are
    summed in pairs up to the first pair that is not positive (Geyer 1992). The first estimate is better for short logs,
    the second for noise with several time scales.
    """
    first = np.clip(sample_correlation(residual, use), 0.0, SURELY)
    each = [_samples_per_effective(residual[:, k], use[:, k]) for k in range(residual.shape[1])]
    return np.sqrt(np.maximum((1.0 + first) / (1.0 - first), np.maximum(each, 1.0)))


def _samples_per_effective(residual: Array, use: NDArray[np.bool_]) -> float:
    """Return 1 + 2 sum of autocorrelations for one joint, by Geyer's initial positive and monotone sequence."""
    counted = use.astype(np.float64)
    kept = np.where(use, residual, 0.0)
    products, pairs = (signal.correlate(x, x, method="fft")[len(x) - 1 :] for x in (kept, counted))
    if not products[0] > 0:
        return 1.0
    enough = np.flatnonzero(np.round(pairs) < FEWEST_PAIRS)
    lags = int(enough[0]) if len(enough) else len(pairs)
    correlation = products[:lags] / np.round(pairs[:lags]) * (pairs[0] / products[0])
    both = correlation[: lags // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(both <= 0)
    positive = np.minimum.accumulate(both[: int(ends[0]) if len(ends) else len(both)])
    return float(2.0 * positive.sum() - 1.0) if len(positive) else 1.0


CORRELATED = 0.5
"""Correlation of neighbouring residuals above which they are not noise: filtered white noise gives 0 +- 0.1."""
NOISY = 1.7
"""Widening from which a fit is said to lack something: white residuals of short logs reach 1.3."""


def noise_warnings(step: str, joint_names: Sequence[str], solved: Estimate) -> tuple[str, ...]:
    """Return warnings if the residuals of a fit are correlated from sample to sample and therefore more than noise.

    The model then lacks an effect. The warnings also give the factor by which standard deviations were increased.
    """
    found = [
        (name, rho) for name, rho in zip(joint_names, solved.correlation, strict=True) if rho > CORRELATED
    ]
    if not found and solved.noise_factor < NOISY:
        return ()
    where = ", ".join(f"{name} ({rho:.2f})" for name, rho in found) or "all joints together"
    text = (
        f"{step}: the residual is no noise but correlated from sample to sample, joint(s) {where}: the model lacks an "
        f"effect there; standard deviations are widened for it, by a factor of about {solved.noise_factor:.1f}"
    )
    return (Remark(text, "residual"),)
