"""Finds the base parameters of robots with mimic joints, whose positions follow that of a leader.

Without mimicry, the robot has more base parameters. The torque of a mimic joint is added to its leader's, so some of
these parameters then appear only in sums. For example, two fingers that close together show the sum of their masses.
The parameters that stay separate are found from sampled rows of the regressor, one column per parameter.

Rows are doubles if no lengths are tiny compared with others and no column is nearly dependent. Otherwise, they are in
extended precision, each coordinate's rows relative to its own torque. All columns are then eliminated together, the
largest first. What remains of a column after elimination is rounding, which can hide an effect of 1e-14.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.extended import Long, extended, has_small_entries, is_of_many_scales
from psdmc.derivation.link_by_link import reduced_to_digits, reduction_link_by_link
from psdmc.derivation.reduce import Reduction, reduced
from psdmc.derivation.units import Scaled
from psdmc.dynamics.following import any_follows
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.slices import first_rates, neutral, normalized
from psdmc.dynamics.torque_rows import echelon_rows
from psdmc.reproducible import times
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array

STATES = 32
"""Sampled motions: three for each of the eleven columns that a joint's own link has to tell apart."""


def reduction_for(scaled: Scaled) -> Reduction:
    """Return the base parameters of a robot, with or without mimic joints, as combinations of its remaining parameters.

    These are the standard parameters that the model's assumptions leave (the columns of `scaled.span`).
    """
    return _of_followers(scaled) if any_follows(scaled.frames) else reduction_of(scaled)


def _of_followers(scaled: Scaled) -> Reduction:
    free = replace(scaled, frames=tuple(replace(frame, follows=None) for frame in scaled.frames))
    tree = reduction_link_by_link(free)
    if is_plain(scaled):
        own = reduced(_flat(_seen(scaled, tree.pivots)))
        if own.is_clear:
            return Reduction(tree.pivots[own.pivots], times(own.echelon, tree.echelon), True)
    rows = _seen(extended(scaled), tree.pivots)
    largest = np.abs(rows).max(axis=(1, 2), keepdims=True, initial=0.0)
    rows = echelon_rows(_flat(np.asarray(rows / np.where(largest > 0.0, largest, 1.0))))
    own = reduced_to_digits(rows, np.zeros(rows.shape[1], dtype=np.int64))
    return Reduction(tree.pivots[own.pivots], times(own.echelon, tree.echelon), False)


def _seen(scaled: Scaled, columns: NDArray[np.int64]) -> Long:
    """(nv, STATES, k) of the span's columns, in the robot's own precision."""
    rows = sampled_regressor(scaled, STATES)
    count, nv, wide = rows.shape
    span = np.asarray((sparse.csr_array(scaled.span.T) @ rows.reshape(-1, wide).T).T)
    return np.asarray(span[:, columns].reshape(count, nv, -1).swapaxes(0, 1))


def _flat(rows: Long) -> Long:
    """All coordinates' rows at one state after those at the one before."""
    return np.ascontiguousarray(rows.swapaxes(0, 1)).reshape(-1, rows.shape[-1])


# The free tree: the echelon form of the regressor at sampled states, or link by link for long chains.
SEED = 20_210_156
"""Seed of the sampled states. Any seed gives the same pivots; a fixed one gives the same bytes."""

STATES_PER_JOINT = 24
"""Sampled states for each joint, n rows each. Eleven are enough for the rank, more improve its condition."""


SAMPLED_JOINTS = 10
"""Longest chain that is sampled as a whole; its rows grow as n^3."""


def reduction_of(scaled: Scaled) -> Reduction:
    """Return the base parameters of a robot without mimic joints.

    They are found from sampled rows of the regressor in double precision if the robot has few joints, of one coordinate
    each. Its lengths and angles must also satisfy `is_plain`, and no column may be nearly dependent on others.
    Otherwise, they are found link by link in extended precision.
    """
    if (
        is_plain(scaled)
        and len(scaled.types) <= SAMPLED_JOINTS
        and all(joint.about_z for joint in scaled.types)
    ):
        reduction = sampled_reduction(scaled)
        if reduction.is_clear:
            return reduction
    return reduction_link_by_link(scaled)


def is_plain(scaled: Scaled) -> bool:
    """Return whether the squares of all angles and lengths of the robot are larger than rounding.

    The result is also false if some joint moves only lengths that are tiny compared with the robot.
    """
    return not is_of_many_scales(scaled) and not has_small_entries(scaled)


def sampled_reduction(scaled: Scaled) -> Reduction:
    """Return the base parameters of a robot, from the regressor at random states in double precision.

    They are combinations of the standard parameters that the model's assumptions leave (the columns of `scaled.span`).
    """
    n = len(scaled.types)
    rows = sampled_regressor(scaled, STATES_PER_JOINT * n).reshape(-1, PARAMETERS_PER_LINK * n)
    return reduced((sparse.csr_array(scaled.span.T) @ rows.T).T)


def sampled_regressor(scaled: Scaled, count: int) -> Array:
    """Return the regressor (count, nv, 11 n) at random states: torques of nv coordinates per standard parameter of n
    links.

    Gravity has strength one, lengths are in the robot's unit, and the floating-point precision is that of `scaled.up`.
    """
    n, nv = len(scaled.types), first_rates(scaled.frames)[-1]
    rng, real = np.random.default_rng(SEED), np.asarray(scaled.up).dtype
    drawn, qd, qdd = (
        list(rng.uniform(-np.pi, np.pi, (size, count)).astype(real))
        for size in (len(neutral(scaled.frames)), nv, nv)
    )
    q = list(normalized(scaled.frames, np.array(drawn)))
    wanted = frozenset(range(PARAMETERS_PER_LINK * n))
    rows = regressor(scaled.frames, scaled.link_frames, wanted, q, qd, qdd, scaled.up)
    values = np.zeros((count, nv, PARAMETERS_PER_LINK * n), real)
    for i, row in enumerate(rows):
        for column, entry in row.items():
            values[:, i, column] = entry
    return values
