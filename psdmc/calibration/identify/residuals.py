"""What residuals say of a fit: their size, and whether they are noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from psdmc.calibration.logs.log import Array


class Judged(Protocol):
    """A solution that knows how its residuals hang together: least_squares.Estimate."""

    @property
    def correlation(self) -> Array: ...
    @property
    def optimism(self) -> float: ...


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


def noise_factor(solved: Judged) -> float:
    """By how much the standard deviations are too small at least, for residuals that are no noise; one where they are."""
    correlated = solved.correlation[solved.correlation > CORRELATED]
    if not len(correlated) and solved.optimism < OPTIMISTIC:
        return 1.0
    by_joint = np.sqrt((1.0 + correlated) / (1.0 - np.minimum(correlated, 0.999)))
    return float(max([*by_joint.tolist(), solved.optimism]))


def noise_warnings(step: str, joint_names: Sequence[str], solved: Judged) -> tuple[str, ...]:
    """Says so where residuals are no noise, for then the standard deviations are too small, and by how much at least."""
    found = [
        (name, rho) for name, rho in zip(joint_names, solved.correlation, strict=True) if rho > CORRELATED
    ]
    factor = noise_factor(solved)
    if factor == 1.0:
        return ()
    where = ", ".join(f"{name} ({rho:.2f})" for name, rho in found) or "all joints together"
    return (
        f"{step}: the residual is no noise but correlated from sample to sample, joint(s) {where}: the model lacks an "
        f"effect there, and standard deviations are too small, by a factor of {factor:.1f} or more",
    )


OPTIMISTIC = 1.7
"""Robust over white standard deviation above which the latter is called too small."""
