"""Poses in which a known load acts on a joint: for each joint's motor sweep."""

from __future__ import annotations

import numpy as np

from psdmc.calibration.identify.predictor import payload_torque
from psdmc.calibration.identify.steps import Load
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.sweeps import swept_range
from psdmc.robot.mechanism import Mechanism

SWEEP_POINTS = 15
UNFELT = 1e-6
"""Share of the load's weight times 1 m (of its weight, where a joint slides) that counts as nothing."""


def motor_poses(
    chain: Mechanism, load: Load, *, tries: int = 400, range_share: float = 0.9, seed: int = 0
) -> tuple[Array, Array]:
    """Random poses (tries, n), and the root mean square (tries, n), N m (N), of the torque by which the load acts on each
    joint over that joint's sweep."""
    rng = np.random.default_rng(seed)
    low, high = np.array([swept_range(joint, range_share) for joint in chain.joints]).T
    poses = rng.uniform(low, high, (tries, len(chain)))
    effect = np.empty((tries, len(chain)))
    for k in range(len(chain)):
        q = np.repeat(poses[:, None], SWEEP_POINTS, axis=1)
        q[:, :, k] = np.linspace(low[k], high[k], SWEEP_POINTS)
        torque = payload_torque(chain, q.reshape(-1, len(chain)), load.mass, load.com)[:, k]
        effect[:, k] = np.sqrt(np.mean(torque.reshape(tries, SWEEP_POINTS) ** 2, axis=1))
    return poses, effect


def unfelt(chain: Mechanism, load: Load, effect: Array) -> tuple[int, ...]:
    """Joints that the load does not act on in any pose: their axes are along gravity, or it lies on them."""
    weight = load.mass * float(np.linalg.norm(chain.gravity))
    return tuple(int(k) for k in np.flatnonzero(effect.max(axis=0) <= UNFELT * weight))
