"""Base parameters link by link, in extended precision: for long chains, and for axes that are nearly parallel.

The rows that all torques depend on hold nothing but rank, joint by joint (dynamics/torque_rows.py): every decision is made
there.
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
    """The base parameters within the span's columns, by graded passes over rows that span the row space and nothing
    more."""
    long = extended(robot)
    rows = torque_rows(long.frames, long.link_frames, long.up)
    links = links_together(robot)[robot.leads // PARAMETERS_PER_LINK]
    return reduced_to_digits(np.asarray((sparse.csr_array(robot.span.T) @ rows.T).T), links)


def links_together(robot: Scaled) -> NDArray[np.int64]:
    """(n,) for each link the first of those whose columns are gone through together with its own.

    Whatever a link does to the joints before it, the link that carries it could do: where that one has all its parameters,
    nothing is left for later links there, and links are gone through one by one. Links that hang on one with fewer
    parameters are each other's equal: what little one of them has alone, another may have in full.
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
    """The base parameters from rows, with residuals compared as they are and not relative to their columns.

    A small column then becomes a pivot late: earlier, its torque would be a large parameter times small numbers, which
    double precision holds with fewer digits. A link's columns come before the next link's, small or not; otherwise a
    parameter of a heavy link could be combined into one of a light link farther out, whose torque would be a small
    difference of large numbers.

    links  (k,) which link each column belongs to
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
