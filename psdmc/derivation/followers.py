"""Base parameters of robots whose joints follow others: fewer than those of the same tree with every joint free.

All torques of the free tree depend on its base parameters alone, and so do their sums onto the leaders. Which of these
parameters the sums tell apart is found from sampled rows, one column for each: two fingers that close together show the sum
of their masses. Rows are doubles where the robot is of one scale and no column is nearly dependent, else of extended
precision, each coordinate's relative to its own torque, and all columns are gone through together, the largest first: what
sampling leaves of a column is its own rounding, which is much beside an effect of 1e-14.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.extended import Long, extended
from psdmc.derivation.link_by_link import reduced_to_digits, reduction_link_by_link
from psdmc.derivation.reduce import Reduction, reduced
from psdmc.derivation.sampled import is_plain, reduction_of, sampled_regressor
from psdmc.derivation.units import Scaled
from psdmc.dynamics.following import any_follows
from psdmc.dynamics.torque_rows import echelon_rows
from psdmc.reproducible import times

STATES = 32
"""Sampled motions: three for each of the eleven columns that a joint's own link has to tell apart."""


def reduction_for(scaled: Scaled) -> Reduction:
    """The base parameters within the span's columns, of robots with and without followers."""
    return _of_followers(scaled) if any_follows(scaled.frames) else reduction_of(scaled)


def _of_followers(scaled: Scaled) -> Reduction:
    free = replace(scaled, frames=tuple(replace(frame, follows=None) for frame in scaled.frames))
    tree = reduction_link_by_link(free)
    if is_plain(scaled):
        own = reduced(_flat(_seen(scaled, tree.pivots)))
        if own.is_clear:
            return Reduction(tree.pivots[own.pivots], times(own.echelon, tree.echelon), True)
    rows = echelon_rows(_flat(_to_own_torque(_seen(extended(scaled), tree.pivots))))
    own = reduced_to_digits(rows, np.zeros(rows.shape[1], dtype=np.int64))
    return Reduction(tree.pivots[own.pivots], times(own.echelon, tree.echelon), False)


def _seen(scaled: Scaled, columns: NDArray[np.int64]) -> Long:
    """(nv, STATES, k) of the span's columns, in the robot's own precision."""
    rows = sampled_regressor(scaled, STATES)
    count, nv, wide = rows.shape
    span = np.asarray((sparse.csr_array(scaled.span.T) @ rows.reshape(-1, wide).T).T)
    return np.asarray(span[:, columns].reshape(count, nv, -1).swapaxes(0, 1))


def _to_own_torque(rows: Long) -> Long:
    """(nv, STATES, k) with each coordinate's largest entry one."""
    largest = np.abs(rows).max(axis=(1, 2), keepdims=True, initial=0.0)
    return np.asarray(rows / np.where(largest > 0.0, largest, 1.0))


def _flat(rows: Long) -> Long:
    """All coordinates' rows at one state after those at the one before."""
    return np.ascontiguousarray(rows.swapaxes(0, 1)).reshape(-1, rows.shape[-1])
