"""Random states of a robot for comparisons, and random masses and inertias, which could exist physically.

Functions that close loops are compared at random positions near positions in which the loops are closed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.closed_loops import loop_error, loop_jacobian
from psdmc.dynamics.coordinates import normalized
from psdmc.dynamics.frames import Frame, frames_of
from psdmc.dynamics.manifold import integrated
from psdmc.dynamics.parameters import inertia_of, standard_parameters
from psdmc.dynamics.solve import factorize, inner_product, solve
from psdmc.model.evaluate import columns
from psdmc.reproducible import times
from psdmc.robot.inertia import leading_rows
from psdmc.robot.mechanism import BODY_PARAMETERS, PARAMETERS_PER_LINK, Array, Loop, Mechanism

RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these."""

SEED = 14_630
"""Of the random masses and inertias."""

STARTS, STEPS = 256, 30
"""`near_closed`: random positions from which loops are closed, and Newton steps of each."""

LONGEST = 0.5
"""rad or m: length of the longest step."""

AWAY = 0.03
"""rad or m: the largest displacement of a passive joint from closed loops."""

BACK, SHORT = 5, 1e-5
"""From each position kept, so many Newton steps of passive joints end with one below this length (rad or m). Positions near
dead points need more steps."""

REGULAR = 1e-4
"""Each row of the passive joints' Jacobian has at least this share of its square that the rows after it do not explain."""

CLOSED = 1e-9
"""m, or rad: largest error of closed loops."""


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


def near_closed(robot: Mechanism, rng: np.random.Generator, count: int) -> Array:
    """Return positions q (count, nq) in which the passive joints are up to AWAY from closing the loops. From there, Newton's
    method converges. They repeat if there are few.

    Newton steps of all joints close the loops. They are damped by the squared errors (Levenberg 1944), which keeps them
    short near dead points. If no loops close, the positions are random.
    """
    frames, loops, passive = frames_of(robot), robot.loops, list(robot.passive_rates)
    q, away, _ = states_of(robot, rng, STARTS)
    away = AWAY * away[:, passive] / np.abs(away).max()
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            q, _, _ = _stepped(frames, loops, q, range(robot.nv), damping=1.0)
        closed = np.abs(columns(loop_error(frames, loops, list(q.T)), len(q))).max(axis=1) < CLOSED
        displaced = np.zeros((STARTS, robot.nv))
        displaced[:, passive] = away
        q = back = columns(integrated(frames, list(q.T), list(displaced.T)), len(q))
        for _ in range(BACK):
            back, size, share = _stepped(frames, loops, back, passive, damping=0.0)
        closed &= (size < SHORT * SHORT) & (share > REGULAR)
    return np.resize(q[closed] if closed.any() else q, (count, robot.nq))


def _stepped(
    frames: Sequence[Frame], loops: Sequence[Loop], q: Array, moving: Sequence[int], damping: float
) -> tuple[Array, Array, Array]:
    """Return q after one Newton step of these rates, and the step's squared length before it was shortened. The third result
    is the smallest share of a row's square that the rows after it do not explain."""
    errors = loop_error(frames, loops, list(q.T))
    rows = [[row[k] for k in moving] for row in loop_jacobian(frames, loops, list(q.T))]
    wide = [[inner_product(a, b) for b in rows] for a in rows]
    for k, error in enumerate(errors):
        wide[k][k] = wide[k][k] + damping * error * error
    factors = factorize(wide)
    shares = solve(factors, errors)
    rest = [pivot / wide[k][k] for k, pivot in enumerate(factors.pivots)]
    step = np.zeros((len(q), sum(frame.joint.nv for frame in frames if frame.mimic is None)))
    step[:, list(moving)] = -columns(
        [inner_product(column, shares) for column in zip(*rows, strict=True)], len(q)
    )
    size = np.sum(step * step, axis=1)
    step *= np.minimum(1.0, LONGEST / np.sqrt(size))[:, None]
    step[~np.isfinite(size)] = 0.0
    return (
        columns(integrated(frames, list(q.T), list(step.T)), len(q)),
        size,
        columns(rest, len(q)).min(axis=1),
    )
