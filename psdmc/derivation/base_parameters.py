"""Finds base parameters by elimination: the independent columns of a robot's torques, and combinations of the others.

A column stands for a standard parameter, such as a mass. Small robots are sampled: rows of the regressor at random
states, in double precision. For long chains and nearly parallel axes, dynamics/regressor.py computes rows of which
all torques are combinations, joint by joint in extended precision, and decides which effects exceed rounding.

The torque of a mimic joint is added to its leader's. Some parameters of the robot without mimicry then appear only in
sums: two fingers that close together show the sum of their masses. Sampled rows of the regressor, with one column per
parameter of that robot, show which parameters stay separate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.scaled import Long, Scaled, extended, has_small_entries, is_of_many_scales
from psdmc.dynamics.coordinates import first_rates, has_mimic_joints, neutral, normalized
from psdmc.dynamics.frames import BASE
from psdmc.dynamics.regressor import echelon_rows, regressor, torque_rows
from psdmc.reproducible import lengths, times, triangle_solved
from psdmc.robot.graded import graded_pivots, halving_shares
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK, Array

PIVOT_TOLERANCE = 1e-10
"""A column of sampled or summed doubles depends on earlier pivots where they leave less than this share of it, and has
no effect where it is below this share of the longest column. Rounding leaves some 1e-14."""

CLEAR = 0.5**10
"""Share of its column that each pivot of a well-conditioned robot leaves at least."""

NOISE = 1e-13
"""Share that rounding alone can leave, in double. A share between this and CLEAR means a nearly dependent column."""

FAIR_ENTRY = 1e4
"""Bound of the echelon form's entries for a well-conditioned robot, lengths in the robot's unit. A column that is small
as a whole can be independent, and other columns are then large multiples of it."""

ECHELON_TOLERANCE = 1e-12
"""Smaller entries of the echelon form are zero, lengths in the robot's unit. Rounding leaves less than 1e-13."""

EXACT = 1e-16
"""Smaller coefficients of the echelon form are zero, lengths in the robot's unit: they add less than the last digit.
Also the share of the longest column below which a column depends on others because of assumed zeros: the longest
column of a long chain has a length of a thousand, and its rounding grows alike."""

SEED = 20_210_156
"""Seed of the sampled states. Any seed gives the same pivots; a fixed one gives the same bytes."""

STATES_PER_JOINT = 24
"""Sampled states for each joint, n rows each. Eleven are enough for the rank, more improve its condition."""

SAMPLED_JOINTS = 10
"""Longest chain that is sampled as a whole; its rows grow as n^3."""

STATES = 32
"""Sampled motions of a robot with mimic joints: three for each of the eleven columns that a joint's own link has to tell
apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """The parameters that lead base parameters, and the combinations of parameters that the base parameters are.

    pivots    (l,) ascending indices of the leading parameters, which have the factor one
    echelon   (l, k) matrix that computes l base parameters from k parameters; a unit vector at each leading one
    is_clear  True: no column was nearly dependent on others, so that double precision is enough
    """

    pivots: NDArray[np.int64]
    echelon: Array
    is_clear: bool = True


def reduction_for(scaled: Scaled) -> Reduction:
    """Return the base parameters of a robot, with or without mimic joints, as combinations of its remaining parameters.

    These are the standard parameters that the model's assumptions leave (the columns of `scaled.span`).
    """
    return _with_mimic_joints(scaled) if has_mimic_joints(scaled.frames) else reduction_of(scaled)


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


def reduced(rows: Array) -> Reduction:
    """Return the base parameters from torque rows (m, k), the reduced row echelon form of these rows.

    Columns become leading ones in their order, if elimination leaves enough of them. The largest remaining column is
    not taken first, because rounding would decide between equal columns.
    """
    work = np.array(rows, order="C")
    norms = lengths(work)
    small = norms <= PIVOT_TOLERANCE * norms.max(initial=0.0)
    dropped = norms[small].max(initial=0.0) / (norms.max(initial=0.0) or 1.0)
    work[:, small] = 0.0
    pivots, taken, left = graded_pivots(work, norms, halving_shares(PIVOT_TOLERANCE))
    is_clear = taken >= CLEAR and max(left, dropped) <= NOISE
    found, kept = np.array(pivots, dtype=np.int64), work[: len(pivots)]
    echelon = triangle_solved(kept[:, found], kept)  # back substitution
    largest = np.abs(echelon).max(axis=1, keepdims=True, initial=0.0)
    echelon[np.abs(echelon) < ECHELON_TOLERANCE * largest] = 0.0
    echelon[:, found] = np.eye(len(found))
    order = np.argsort(found)
    is_fair = bool(np.abs(echelon).max(initial=0.0) <= FAIR_ENTRY)
    return Reduction(found[order], echelon[order], is_clear and is_fair)


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


def reduction_link_by_link(robot: Scaled) -> Reduction:
    """Return the base parameters of a robot by elimination of columns from rows that span all possible torques.

    A column stands for one of the standard parameters that the model's assumptions leave (see `robot.span`).
    """
    long = extended(robot)
    rows = torque_rows(long.frames, long.link_frames, long.up)
    links = links_together(robot)[robot.leads // PARAMETERS_PER_LINK]
    return reduced_to_digits(np.asarray((sparse.csr_array(robot.span.T) @ rows.T).T), links)


def links_together(robot: Scaled) -> NDArray[np.int64]:
    """Return (n,) for each link, the first of the links whose parameters are compared with the link's own.

    Any torque of a link on the joints before it can also come from the link that carries it. If that carrying link has
    all its parameters, they replace those of the later links, and links are treated one by one. Links attached to a
    link with fewer parameters are treated together. One of them may have in full what another has only a small part of.
    """
    parents = [frame.parent for frame in robot.frames]
    own = robot.leads[robot.leads % PARAMETERS_PER_LINK != DRIVE] // PARAMETERS_PER_LINK
    is_full = np.bincount(own, minlength=len(parents)) == BODY_PARAMETERS
    first = np.arange(len(parents))
    for k, above in enumerate(parents):
        if above != BASE and not is_full[above] and (parents.count(above) > 1 or first[above] != above):
            first[k] = first[above]
    return first


def reduced_to_digits(rows: Long, links: NDArray[np.int64]) -> Reduction:
    """Return the base parameters of a robot, by elimination in a matrix whose product with the link parameters is
    torques.

    Elimination chooses independent columns, called pivots. Each pivot gives one base parameter: the pivot's link
    parameter with the factor one, plus multiples of parameters that are not pivots. Pivots are chosen link by link.
    Otherwise, a parameter of a heavy link could be combined into that of a light link farther out. The torque of the
    light link would then be a small difference of large numbers.

    Within a link, the largest columns come first. The size of a column is the absolute length that elimination leaves.
    A small column as an early pivot would give a large parameter times small numbers, which loses digits.

    rows   (m, k) the matrix: m torques, k link parameters
    links  (k,) the link to which each parameter belongs
    """
    work = np.array(rows, order="C")
    last = EXACT * max(1.0, float(lengths(work).max(initial=0.0)))
    found, _, _ = graded_pivots(work, np.ones(work.shape[1]), halving_shares(last), links)
    pivots = np.array(found, dtype=np.int64)
    others = np.setdiff1d(np.arange(work.shape[1]), pivots)
    shares = triangle_solved(work[: len(pivots), pivots], work[: len(pivots), others])
    echelon = np.zeros((len(pivots), work.shape[1]))
    echelon[:, pivots] = np.eye(len(pivots))
    echelon[:, others] = np.where(np.abs(shares) < EXACT, 0.0, shares)
    order = np.argsort(pivots)
    return Reduction(pivots[order], echelon[order], False)


def _with_mimic_joints(scaled: Scaled) -> Reduction:
    """Return the base parameters of a robot with mimic joints.

    Rows are doubles if the robot is plain and no column is nearly dependent. Otherwise, they are in extended precision,
    each coordinate's rows relative to its own torque. All columns are then eliminated together, the largest first. What
    remains of a column after elimination is rounding, which can hide an effect of 1e-14.
    """
    free = replace(scaled, frames=tuple(replace(frame, mimic=None) for frame in scaled.frames))
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
