"""The origin of a model: all data that psdmc needs to read the model's robot file again."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from psdmc.dynamics.coordinates import first_rates, neutral, normalized
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.model.random_states import RANGES
from psdmc.robot.load import LoadedRobot
from psdmc.robot.mechanism import Array, Mechanism


def provenance(loaded: LoadedRobot) -> dict[str, Any]:
    """Return the model's origin as plain JSON values, with which psdmc can read the robot file again."""
    effect = snap_effect(loaded.mechanism, loaded.unsnapped().chain) if loaded.snap_report else None
    return {
        "source_text": loaded.source_text,
        "source_sha256": hashlib.sha256(loaded.source_text.encode()).hexdigest(),
        "source_format": loaded.source_format,
        "source_name": loaded.source_name,
        "options": loaded.options.as_json(),
        "snapped": [{"where": snap.where, "angle_rad": snap.angle} for snap in loaded.snap_report],
        "snap_torque_change": None if effect is None else effect.tolist(),
    }


SEED = 31_416
SAMPLES = 256


def snap_effect(snapped: Mechanism, unsnapped: Mechanism) -> Array | None:
    """Return (nv,) the largest torque change at random states, N m or N, from replacing rounded angles by exact ones.

    An example is 1.5708 rad, which is replaced by a right angle. The result is None if parameters are unknown.
    """
    if np.isnan(snapped.parameters).any() or np.isnan(unsnapped.parameters).any():
        return None
    return np.asarray(np.max(np.abs(_torques(snapped) - _torques(unsnapped)), axis=1))


def _torques(chain: Mechanism) -> Array:
    """(nv, SAMPLES)"""
    rng = np.random.default_rng(SEED)
    frames = frames_of(chain)
    rates = first_rates(frames)[-1]
    sizes = (len(neutral(frames)), rates, rates)
    q, qd, qdd = (
        limit * rng.uniform(-1.0, 1.0, (size, SAMPLES)) for limit, size in zip(RANGES, sizes, strict=True)
    )
    torques = inverse_dynamics(
        frames,
        bodies_of(chain, chain.parameters),
        drive_inertia_of(chain.parameters),
        list(normalized(frames, q)),
        list(qd),
        list(qdd),
        base_acceleration(chain),
    )
    return np.stack([np.broadcast_to(torque, (SAMPLES,)) for torque in torques])
