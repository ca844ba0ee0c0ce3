"""Finds base parameters link by link in extended precision, for long chains and for axes that are nearly parallel.

dynamics/torque_rows.py computes regressor rows of which all torques are combinations, joint by joint. That module also
decides which effects are larger than rounding. Here the dependent columns (parameters) of these rows are eliminated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.extended import Long, extended
from psdmc.derivation.reduce import Reduction
from psdmc.derivation.units import Scaled
from psdmc.dynamics.frames import BASE
from psdmc.dynamics.torque_rows import EFFECT as EFFECT
from psdmc.dynamics.torque_rows import torque_rows
from psdmc.reproducible import lengths, triangle_solved
from psdmc.robot.graded import graded_pivots, halving_shares
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK

EXACT = 1e-16
"""Smaller coefficients of the echelon form are zero, lengths in the robot's unit: they add less than the last digit.
Also the share of the longest column below which a column depends on others because of assumed zeros: the longest
column of a long chain has a length of a thousand, and its rounding grows alike."""


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
    """Return the base parameters from rows whose columns stand for parameters, preferring large columns as leading
    ones.

    A leading parameter (pivot) has the factor one in its base parameter. Columns are compared by the absolute size that
    elimination leaves, not relative to their original size. A small column as an early pivot would give a large
    parameter times small numbers, which loses digits. All columns of a link, small or not, come before those of the
    next link. Otherwise, a parameter of a heavy link could be combined into that of a light link farther out. The
    torque of the light link would then be a small difference of large numbers.

    rows   (m, k) torque rows
    links  (k,) the link to which each column belongs
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
