"""Poses in which a known load acts on a joint: one for each joint's motor sweep."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.identify.predictor import payload_torque
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.sweeps import swept_range
from psdmc.robot.mechanism import Mechanism

SWEEP_POINTS = 15


def motor_poses(
    chain: Mechanism,
    mass: float,
    com: tuple[float, float, float],
    *,
    tries: int = 400,
    range_share: float = 0.9,
    seed: int = 0,
) -> Array:
    """(n, n) row k: the pose, of `tries` random ones, in which the load's torque varies most over joint k's sweep."""
    rng = np.random.default_rng(seed)
    low, high = np.array([swept_range(joint, range_share) for joint in chain.joints]).T
    poses = rng.uniform(low, high, (tries, len(chain)))
    best = np.empty((len(chain), len(chain)))
    for k in range(len(chain)):
        q = np.repeat(poses[:, None], SWEEP_POINTS, axis=1)
        q[:, :, k] = np.linspace(low[k], high[k], SWEEP_POINTS)
        torque = payload_torque(chain, q.reshape(-1, len(chain)), mass, com)[:, k].reshape(
            tries, SWEEP_POINTS
        )
        best[k] = poses[int(np.argmax(np.mean(torque**2, axis=1)))]
    return best
