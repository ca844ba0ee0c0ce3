"""Finds base parameters by elimination: the independent columns of a robot's torques, and combinations of the others.

The columns stand for standard parameters, such as masses, and are tried in the order of these parameters. The
coefficients of velocity terms are combinations of those of the mass matrix. So the mass matrix and gravity are enough.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.derivation.terms import Terms
from psdmc.reproducible import lengths, triangle_solved
from psdmc.robot.graded import graded_pivots, halving_shares

Array = NDArray[np.float64]

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


_BLOCK_ROWS = 8192
"""Rows reduced at once, so that the whole stack is never held as a dense matrix."""


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


def row_space(blocks: Iterable[Terms], columns: int) -> Array:
    """Return the triangular factor R (k, k) of a tall matrix A with k columns of torque coefficients: R^T R = A^T A.

    A has one row for each torque row and monomial of the blocks. It is factorized block by block, so it need not fit
    into memory.
    """
    factor: Array = np.zeros((0, columns))
    for block in blocks:
        for rows in _dense_rows(block, columns):
            factor = triangular(np.vstack([factor, rows]))
    return factor


def triangular(rows: Array) -> Array:
    """Return the triangular factor R of rows = Q R."""
    factor: Array = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
    return factor


def _dense_rows(terms: Terms, columns: int) -> Iterable[Array]:
    if not len(terms.value):
        return
    key = terms.row * (int(terms.monomial.max()) + 1) + terms.monomial
    _, place = np.unique(key, return_inverse=True)
    order = np.argsort(place, kind="stable")
    place, column, value = place[order], terms.column[order], terms.value[order]
    for start in range(0, int(place[-1]) + 1, _BLOCK_ROWS):
        first, last = np.searchsorted(place, [start, start + _BLOCK_ROWS])
        rows = np.zeros((int(place[last - 1]) + 1 - start, columns))
        np.add.at(rows, (place[first:last] - start, column[first:last]), value[first:last])
        yield rows


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
    # Back substitution.
    found, kept = np.array(pivots, dtype=np.int64), work[: len(pivots)]
    echelon = triangle_solved(kept[:, found], kept)
    largest = np.abs(echelon).max(axis=1, keepdims=True, initial=0.0)
    echelon[np.abs(echelon) < ECHELON_TOLERANCE * largest] = 0.0
    echelon[:, found] = np.eye(len(found))
    order = np.argsort(found)
    is_fair = bool(np.abs(echelon).max(initial=0.0) <= FAIR_ENTRY)
    return Reduction(found[order], echelon[order], is_clear and is_fair)
