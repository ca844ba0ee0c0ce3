"""Random states of a robot for comparisons of torques, and random masses and inertias, which could exist physically."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.coordinates import normalized
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.parameters import inertia_of, standard_parameters
from psdmc.reproducible import times
from psdmc.robot.inertia import leading_rows
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Array, Mechanism

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
    """Return for each of k vectors q the nearest possible positions, (k, nq), such as quaternions of length one."""
    return normalized(frames_of(robot), q.T).T


SEED = 14_630


def random_parameters(chain: Mechanism) -> Array:
    """Return (11 n,) random standard parameters of links that can exist physically, as far as the robot's assumptions
    allow. Parameters that are assumed zero are zero."""
    rng = np.random.default_rng(SEED)
    x = np.zeros((len(chain), PARAMETERS_PER_LINK))
    for link in x:
        mass, centre = rng.uniform(1.0, 5.0), rng.uniform(-0.1, 0.1, size=3)
        shape = rng.normal(scale=0.1, size=(3, 3))
        second = mass * (times(shape, shape.T) + np.outer(centre, centre))
        link[:BODY_PARAMETERS] = standard_parameters(mass, mass * centre, inertia_of(second))
        link[BODY_PARAMETERS] = rng.uniform(0.1, 0.5)
    span = chain.parameter_span
    leads = leading_rows(span)
    admitted: Array = times(span, x.reshape(-1)[leads])
    return admitted
