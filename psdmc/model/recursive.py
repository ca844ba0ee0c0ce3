"""The model's torques, mass matrix and regressor, computed by the recursive algorithms of psdmc.dynamics without E and
P. The time does not depend on the number of monomials of the torques."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.composite_body import mass_matrix as composite_bodies
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics as newton_euler
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.dynamics.regressor import regressor as standard_regressor
from psdmc.dynamics.scalar import Scalar
from psdmc.robot.mechanism import Array, Mechanism


def torques(chain: Mechanism, x: Array, arrays: list[Array]) -> Array:
    """Compute joint torques tau (states, n), N m or N, from the links' parameters (11n,) and q, qd, qdd."""
    q, qd, qdd = (list(array.T) for array in arrays)
    bodies, drives = bodies_of(chain, x), drive_inertia_of(x)
    found = newton_euler(frames_of(chain), bodies, drives, q, qd, qdd, base_acceleration(chain))
    return _columns(found, len(arrays[0]))


def mass_matrix(chain: Mechanism, x: Array, q: Array) -> Array:
    """Compute the mass matrix M(q), (states, n, n), from q (states, n) and the links' standard parameters (11n,), by
    the composite-rigid-body algorithm."""
    rows = composite_bodies(frames_of(chain), bodies_of(chain, x), drive_inertia_of(x), list(q.T))
    return np.stack([_columns(row, len(q)) for row in rows], axis=1)


def regressor(chain: Mechanism, representative: Array, arrays: list[Array]) -> Array:
    """Compute the regressor Y (states, n, l), with the torques tau = Y theta_b, at q, qd, qdd (states, n).

    representative  (11n, l)  matrix from base parameters to standard parameters
    """
    wanted = np.flatnonzero(representative.any(axis=1)).tolist()
    full = link_regressor(chain, wanted, arrays)
    # BLAS: nothing of this is written, and long chains have millions of products.
    result: Array = full @ representative[wanted]
    return result


def link_regressor(chain: Mechanism, wanted: Sequence[int], arrays: list[Array]) -> Array:
    """Compute the columns `wanted` of the regressor (states, n, wanted) of the links' standard parameters (11n,), at q, qd,
    qdd (states, n)."""
    q, qd, qdd = (list(array.T) for array in arrays)
    placements = [joint.link_frame for joint in chain.joints]
    rows = standard_regressor(
        frames_of(chain), placements, frozenset(wanted), q, qd, qdd, base_acceleration(chain)
    )
    count = len(arrays[0])
    return np.stack([_columns([row.get(c, 0.0) for c in wanted], count) for row in rows], axis=1)


def _columns(values: Sequence[Scalar], count: int) -> Array:
    """(count, len(values)) from scalars or (count,) arrays."""
    found = np.empty((count, len(values)))
    for i, value in enumerate(values):
        found[:, i] = value
    return found
