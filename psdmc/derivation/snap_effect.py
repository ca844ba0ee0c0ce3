"""The effect of snapping: torques of the snapped chain compared with those of the file's own numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.model.random_states import random_states
from psdmc.robot.mechanism import Mechanism

Array = NDArray[np.float64]

SEED = 31_416
SAMPLES = 256


def snap_effect(snapped: Mechanism, unsnapped: Mechanism) -> Array | None:
    """(n,) largest torque change per joint over random states, N m (N); None where parameters are unknown."""
    if np.isnan(snapped.parameters).any() or np.isnan(unsnapped.parameters).any():
        return None
    return np.asarray(np.max(np.abs(_torques(snapped) - _torques(unsnapped)), axis=1))


def _torques(chain: Mechanism) -> Array:
    """(n, SAMPLES)"""
    rng = np.random.default_rng(SEED)
    q, qd, qdd = random_states(rng, chain.nv, SAMPLES)
    torques = inverse_dynamics(
        frames_of(chain),
        bodies_of(chain, chain.parameters),
        drive_inertia_of(chain.parameters),
        list(q),
        list(qd),
        list(qdd),
        base_acceleration(chain),
    )
    return np.stack([np.broadcast_to(torque, (SAMPLES,)) for torque in torques])
