"""Base parameters without E and P: the echelon form of the regressor at sampled states, for chains of any length."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.extended import has_small_entries, is_of_many_scales
from psdmc.derivation.link_by_link import reduction_link_by_link
from psdmc.derivation.reduce import Reduction, reduced
from psdmc.derivation.units import Scaled
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.slices import first_rates, neutral, normalized
from psdmc.robot.mechanism import PARAMETERS_PER_LINK

Array = NDArray[np.float64]

SEED = 20_210_156
"""Seed of the sampled states. Any seed gives the same pivots; a fixed one gives the same bytes."""

STATES_PER_JOINT = 24
"""Sampled states for each joint, n rows each. Eleven are enough for the rank, more improve its condition."""


SAMPLED_JOINTS = 10
"""Longest chain that is sampled as a whole; its rows grow as n^3."""


def reduction_of(scaled: Scaled) -> Reduction:
    """The base parameters. They are found from sampled rows of doubles where joints have one coordinate each, rows are few
    and of one scale, angles and
    lengths are not so small that their squares are rounding, and no column is nearly dependent; else link by link in
    extended precision."""
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
    """Whether the robot is of one scale and has no angle or length whose square is rounding."""
    return not is_of_many_scales(scaled) and not has_small_entries(scaled)


def sampled_reduction(scaled: Scaled) -> Reduction:
    """Find the base parameters of the expanded path from samples, within the span's columns."""
    n = len(scaled.types)
    rows = sampled_regressor(scaled, STATES_PER_JOINT * n).reshape(-1, PARAMETERS_PER_LINK * n)
    return reduced((sparse.csr_array(scaled.span.T) @ rows.T).T)


def sampled_regressor(scaled: Scaled, count: int) -> Array:
    """(count, nv, 11 n) regressor at random states, in the robot's unit and the precision of its vertical; gravity of
    strength one."""
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
