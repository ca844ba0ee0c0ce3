"""Random states of a robot, for comparisons of torques."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.slices import normalized
from psdmc.robot.mechanism import Array, Mechanism

RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these."""


def random_states(rng: np.random.Generator, *shape: int) -> tuple[Array, Array, Array]:
    """Return three random arrays of the given shape: joint positions q, rates qd and accelerations qdd."""
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, shape) for limit in RANGES)
    return q, qd, qdd


def states_of(robot: Mechanism, rng: np.random.Generator, count: int) -> tuple[Array, Array, Array]:
    """Return random q (count, nq), qd and qdd (count, nv) of a robot; quaternions have length one."""
    sizes = (robot.nq, robot.nv, robot.nv)
    q, qd, qdd = (
        limit * rng.uniform(-1.0, 1.0, (count, size)) for limit, size in zip(RANGES, sizes, strict=True)
    )
    return on_joints(robot, q), qd, qdd


def on_joints(robot: Mechanism, q: Array) -> Array:
    """Return, for each of k vectors q, the nearest positions that the joints can have, (k, nq). For example,
    quaternions get length one."""
    return normalized(frames_of(robot), q.T).T
