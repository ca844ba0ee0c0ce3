"""The quality of a prediction: RMSE and R^2."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import Quality


def quality(measured: Array, predicted: Array) -> Quality:
    """The quality of one joint, (N,) each: R^2 = 1 - sum of squared errors over that about the mean."""
    if len(measured) == 0:
        return Quality(float("nan"), float("nan"))
    error = float(np.mean((measured - predicted) ** 2))
    spread = float(np.var(measured))
    return Quality(float(np.sqrt(error)), 1.0 - error / spread if spread > 0 else float("nan"))


def qualities(measured: Array, predicted: Array) -> tuple[Quality, ...]:
    """The quality of every joint, (N, n) each."""
    return tuple(quality(measured[:, k], predicted[:, k]) for k in range(measured.shape[1]))
