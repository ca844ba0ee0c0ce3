"""Computes the rows of the regressor, the matrix whose product with theta_b is the joint torques. Code is recorded on
symbols, and references are computed in NumPy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.scalar import Scalar
from psdmc.recipes.on_arrays import RobotOnArrays, columns
from psdmc.recipes.recipe import Ingredients
from psdmc.reproducible import times
from psdmc.robot.mechanism import Array


def traced_rows(
    g: Ingredients, qdd: Sequence[Scalar], qd_r: Sequence[Scalar] | None = None
) -> list[list[Scalar]]:
    """Return the regressor, n rows of l entries: the derivatives of joint torques by the base parameters theta_b. It is
    recorded as code.

    The torques are M qdd + C(q, qd) qd_r + g, with the Coriolis matrix C and the torque g of gravity. Without qd_r, C
    multiplies qd.
    """
    needed = [j for j in range(len(g.lift)) if g.lift[j].any()]
    q, qd = g.inputs["q"], g.inputs["qd"]
    found = regressor(g.frames, g.link_frames, set(needed), q, qd, qdd, g.base_acceleration, qd_r)
    weights = [[(j, x) for j, x in enumerate(column) if x] for column in g.lift.T.tolist()]
    return [[_entry(column, row) for column in weights] for row in found]


def _entry(weights: Sequence[tuple[int, float]], row: dict[int, Scalar]) -> Scalar:
    total: Scalar = 0.0
    for j, weight in weights:
        if j in row:
            total = total + row[j] * weight
    return total


def rows_on_arrays(robot: RobotOnArrays, q: Array, qd: Array, qdd: Array, qd_r: Array | None = None) -> Array:
    """Return the regressor (k, n, l) for k states, computed in NumPy. It has the entries of `traced_rows`."""
    wanted = np.flatnonzero(robot.lift.any(axis=1)).tolist()
    places = [joint.link_frame for joint in robot.chain.joints]
    states = (list(q.T), list(qd.T), list(qdd.T))
    rates = None if qd_r is None else list(qd_r.T)
    rows = regressor(robot.frames, places, frozenset(wanted), *states, robot.base_acceleration, rates)
    full = np.stack([columns([row.get(c, 0.0) for c in wanted], len(q)) for row in rows], axis=1)
    return np.asarray(times(full, robot.lift[wanted]))
