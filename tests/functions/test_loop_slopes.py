"""Derivatives of closed loops are differences of their Jacobians, drifts and errors, for both orders of their frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from loop_trees import loop_tree

from psdmc.dynamics.closed_loops import (
    loop_drift,
    loop_error,
    loop_error_slopes,
    loop_jacobian,
    loop_pushes,
    loop_slopes,
)
from psdmc.dynamics.frames import frames_of
from psdmc.dynamics.manifold import integrated

Array = np.ndarray
STEP = 1e-2


def rows(values: Sequence[object], count: int) -> Array:
    return np.stack([np.broadcast_to(value, count) for value in values], axis=1)


def matrices(values: Sequence[Sequence[object]], count: int) -> Array:
    return np.stack([rows(row, count) for row in values], axis=1)


@pytest.mark.parametrize("turned", [False, True])
def test_they_are_central_differences_of_sixth_order(turned: bool) -> None:
    """Turned, the floating base carries the first frame of a loop: a joint of six rates that counts backwards."""
    own = loop_tree(0, True)
    robot, (q, qd), count = own.loaded.mechanism, (own.given["q"], own.given["qd"]), len(own.given["q"])
    loops = [replace(loop, first=loop.second, second=loop.first) for loop in robot.loops]
    loops, frames, rng = (loops if turned else robot.loops), frames_of(robot), np.random.default_rng(3)
    qdd, forces = rng.normal(size=qd.shape), rng.normal(size=(count, sum(len(loop.rows) for loop in loops)))

    def jacobian(q: Array) -> Array:
        return matrices(loop_jacobian(frames, loops, list(q.T)), count)

    def accelerations(q: Array, qd: Array) -> Array:
        drift = rows(loop_drift(frames, loops, list(q.T), list(qd.T)), count)
        return np.einsum("kij,kj->ki", jacobian(q), qdd) + drift

    def difference(function: Callable[[Array], Array]) -> Array:
        columns = []
        for way in STEP * np.eye(robot.nv):
            here = [
                function(rows(integrated(frames, list(q.T), list(k * way)), count))
                for k in (-3, -2, -1, 1, 2, 3)
            ]
            weights = (-1 / 60, 3 / 20, -3 / 4, 3 / 4, -3 / 20, 1 / 60)
            columns.append(sum(w * x for w, x in zip(weights, here, strict=True)) / STEP)
        return np.stack(columns, axis=-1)

    by_q, by_qd = (
        matrices(block, count) for block in loop_slopes(frames, loops, list(q.T), list(qd.T), list(qdd.T))
    )
    unit = np.eye(robot.nv)
    exact = [
        0.5 * (accelerations(q, qd + way) - accelerations(q, qd - way)) for way in unit
    ]  # quadratic in qd
    pushes = matrices(loop_pushes(frames, loops, list(q.T), list(forces.T)), count)
    for found, expected in (
        (by_q, difference(lambda there: accelerations(there, qd))),
        (by_qd, np.stack(exact, axis=-1)),
        (pushes, difference(lambda there: np.einsum("kij,ki->kj", jacobian(there), forces))),
    ):
        assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
    slopes = matrices(loop_error_slopes(frames, loops, list(q.T)), count)
    expected = difference(lambda there: rows(loop_error(frames, loops, list(there.T)), count))
    near = np.abs(rows(loop_error(frames, loops, list(q.T)), count)).max(axis=1) < 3.0  # far from half a turn
    assert near.sum() >= 4
    assert np.abs(slopes - expected)[near].max() < 1e-8 * np.abs(expected[near]).max()
