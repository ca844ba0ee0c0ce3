"""The quality of predicted torques: root mean square error (RMSE) and R^2."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.logs.log import Array
from psdmc.model.calibrated import Quality


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
    """Return R^2 and root mean square error of each joint's predicted torque, from measured and predicted torques (N,
    n)."""
    return tuple(quality(measured[:, k], predicted[:, k]) for k in range(measured.shape[1]))
