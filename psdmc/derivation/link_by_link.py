"""Base parameters found link by link in extended precision, for long chains and for axes that are nearly parallel.

They are found from rows that all torques are combinations of. dynamics/torque_rows.py computes these rows joint by
joint, and decides there which effects are larger than rounding.
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
    """Return the base parameters within the span's columns, by eliminating columns from rows that span the row space of
    all torques."""
    long = extended(robot)
    rows = torque_rows(long.frames, long.link_frames, long.up)
    links = links_together(robot)[robot.leads // PARAMETERS_PER_LINK]
    return reduced_to_digits(np.asarray((sparse.csr_array(robot.span.T) @ rows.T).T), links)


def links_together(robot: Scaled) -> NDArray[np.int64]:
    """(n,) for each link, the first of the links whose columns are eliminated together with its own.

    Any effect of a link on the joints before it could also come from the link that carries it. If that carrying link
    has all its parameters, later links add nothing there, and links are eliminated one by one. Links attached to a link
    with fewer parameters are treated alike: one of them may have in full what another has only a small part of.
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
    """Return the base parameters from rows. Columns are compared by their remaining absolute size, not relative to
    their original size.

    A small column then becomes a pivot late. If it were a pivot earlier, its torque would be a large parameter times
    small numbers, which loses digits. All columns of a link, small or not, come before those of the next link.
    Otherwise, a parameter of a heavy link could be combined into one of a light link farther out, whose torque would
    then be a small difference of large numbers.

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
