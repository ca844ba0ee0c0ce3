"""The covariance of the base parameters that a calibrated model keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import stats

from psdmc.calibration.calibrate import CalibrateOptions, calibrate_logs
from psdmc.calibration.logs.log import Log
from psdmc.model.load import load
from psdmc.model.store import save

RATE = 200.0


def test_the_truth_lies_in_the_ellipsoid_of_the_file_s_covariance(arm, tmp_path: Path):
    """Log by log (truth - found)^2 in the metric of the covariance is chi-squared of as many degrees as there are
    parameters; so it is in the direction where their errors cancel most, which standard deviations alone miss."""
    distances, narrow, alone = [], [], []
    time = np.arange(0.0, 20.0, 1.0 / RATE)
    w = 2.0 * np.pi * np.array([[0.31, 0.47], [0.83, 0.71], [1.13, 1.37]])
    turning = time[:, None, None] * w + np.array([0.0, 0.4])
    q = 0.3 * np.sin(turning).sum(axis=1)
    qd, qdd = 0.3 * (w * np.cos(turning)).sum(axis=1), -0.3 * (w**2 * np.sin(turning)).sum(axis=1)
    torque = arm.regressor.regressor(q, qd, qdd) @ arm.model.theta_b + np.tanh(qd / 0.03) + 0.5 * qd
    for seed in range(12):
        noise = np.random.default_rng(seed).normal(scale=2.0, size=q.shape)
        log = Log("log", arm.model.joint_names, time, q, qd, torque + noise, "motor_torque")
        options = CalibrateOptions(physical=False)
        record = calibrate_logs(arm.unknown, [log], options, arm.regressor, None, lambda step: None)
        save(record.model, tmp_path / "model.npz")
        found = load(tmp_path / "model.npz")
        assert found.calibrated is not None
        covariance = found.calibrated.covariance
        assert covariance is not None
        fixed = np.isfinite(found.calibrated.std)
        assert np.allclose(np.sqrt(np.diag(covariance))[fixed], found.calibrated.std[fixed], rtol=1e-12)
        error = found.theta_b - arm.model.theta_b
        distances.append(error @ np.linalg.solve(covariance, error))
        std = np.sqrt(np.diag(covariance))
        values, axes = np.linalg.eigh(covariance / np.outer(std, std))
        along = float(axes[:, 0] @ (error / std)) ** 2
        narrow.append(along / values[0])
        alone.append(along)
    for found, freedom in ((distances, len(distances) * arm.model.l), (narrow, len(narrow))):
        low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], freedom)
        assert low < sum(found) < high
    assert sum(alone) < low
