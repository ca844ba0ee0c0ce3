"""Random positions of a robot near positions in which its closed loops are closed, for comparisons of functions that close
them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.closed_loops import loop_error, loop_jacobian
from psdmc.dynamics.frames import Frame, frames_of
from psdmc.dynamics.manifold import integrated
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inner_product, solve
from psdmc.model.random_states import states_of
from psdmc.robot.mechanism import Array, Loop, Mechanism

STARTS, STEPS = 256, 30
"""Random positions from which loops are closed, and Newton steps of each."""

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
        closed = np.abs(_rows(loop_error(frames, loops, list(q.T)), q)).max(axis=1) < CLOSED
        displaced = np.zeros((STARTS, robot.nv))
        displaced[:, passive] = away
        q = back = _rows(integrated(frames, list(q.T), list(displaced.T)), q)
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
    step = np.zeros((len(q), sum(frame.joint.nv for frame in frames if frame.follows is None)))
    step[:, list(moving)] = -_rows([inner_product(column, shares) for column in zip(*rows, strict=True)], q)
    size = np.sum(step * step, axis=1)
    step *= np.minimum(1.0, LONGEST / np.sqrt(size))[:, None]
    step[~np.isfinite(size)] = 0.0
    return _rows(integrated(frames, list(q.T), list(step.T)), q), size, _rows(rest, q).min(axis=1)


def _rows(values: Sequence[Scalar], q: Array) -> Array:
    """(k, values) from numbers and from arrays (k,), for the k positions q."""
    return np.stack([np.broadcast_to(value, len(q)) for value in values], axis=1)
