"""Chains whose axes are nearly parallel: the axis of every joint but the first is off the one before by about one tilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from random_chains import random_chain

from psdmc.robot.mechanism import Mechanism, Placement


def tilted_chain(seed: int, kinds: str, tilt: float) -> Mechanism:
    """Turned and placed anywhere about and across the axes; link frames are the joint frames."""
    chain = random_chain(seed, kinds)
    rng = np.random.default_rng([30, seed])
    joints = []
    for k, joint in enumerate(chain.joints):
        x, y = tilt * rng.uniform(-1.0, 1.0, 2) * (k > 0)
        rotation = _about(0, x) @ _about(1, y) @ _about(2, rng.uniform(-3.0, 3.0))
        if k == 0 and seed % 2:
            rotation = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
        place = Placement(rotation, rng.uniform(-0.5, 0.5, 3))
        joints.append(replace(joint, placement=place, link_frame=Placement.identity()))
    return replace(chain, joints=tuple(joints))


def _about(axis: int, angle: float) -> np.ndarray:
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = np.cos(angle)
    rotation[j, i], rotation[i, j] = np.sin(angle), -np.sin(angle)
    return rotation
