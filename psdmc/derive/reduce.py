"""Base parameters: the reduced row echelon form of the coefficients, pivots in the parameters' own order.

Velocity terms are derivatives of the mass matrix in coefficient space, so their coefficients are combinations
of its: mass matrix and gravity alone span the row space.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from psdmc.derive.terms import Terms

Array = NDArray[np.float64]

PIVOT_TOLERANCE = 1e-10
"""A column of sampled or summed doubles whose share left by earlier pivots is below this depends on them; one below
this share of the longest column has no effect. Rounding leaves some 1e-14."""

CLEAR = 0.5**10
"""Share that a pivot of a well-conditioned robot leaves at least."""

NOISE = 1e-13
"""Share that rounding alone can leave, in double. What lies between this and CLEAR is a nearly dependent column."""

ECHELON_TOLERANCE = 1e-12
"""Smaller entries of the echelon form are zero, lengths in the robot's unit. Rounding leaves less than
1e-13."""


def halving_shares(last: float) -> tuple[float, ...]:
    """1/2, 1/4, ... down to `last`: the parameters are gone through once for each of these, in their own order, and one
    becomes a pivot where what earlier pivots leave of its column exceeds this share of it. One pass with `last` alone
    would find as many, but would divide by small residuals where large ones are to be had."""
    count = math.ceil(-math.log2(last))
    return (*(0.5**k for k in range(1, count)), last)


_BLOCK_ROWS = 8192
"""Rows reduced at once, so that the stack is never held dense as a whole."""


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """Which columns are base parameters, and what they stand for.

    pivots   (l,)     column indices, ascending
    echelon  (l, k)   base parameters = echelon @ columns' parameters; a unit vector at each pivot
    is_clear          no column was nearly dependent: double precision has decided, and well
    """

    pivots: NDArray[np.int64]
    echelon: Array
    is_clear: bool = True


def row_space(blocks: Iterable[Terms], columns: int) -> Array:
    """(k, k) triangular factor R of all rows (row, function) of the blocks: R^T R = A^T A, found by blocked
    QR."""
    factor: Array = np.zeros((0, columns))
    for block in blocks:
        for rows in _dense_rows(block, columns):
            factor = triangular(np.vstack([factor, rows]))
    return factor


def triangular(rows: Array) -> Array:
    """The factor R of rows = Q R."""
    factor: Array = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
    return factor


def _dense_rows(terms: Terms, columns: int) -> Iterable[Array]:
    if not len(terms.value):
        return
    key = terms.row * (int(terms.function.max()) + 1) + terms.function
    _, place = np.unique(key, return_inverse=True)
    order = np.argsort(place, kind="stable")
    place, column, value = place[order], terms.column[order], terms.value[order]
    for start in range(0, int(place[-1]) + 1, _BLOCK_ROWS):
        first, last = np.searchsorted(place, [start, start + _BLOCK_ROWS])
        rows = np.zeros((int(place[last - 1]) + 1 - start, columns))
        np.add.at(rows, (place[first:last] - start, column[first:last]), value[first:last])
        yield rows


def reduced(rows: Array) -> Reduction:
    """Reduced row echelon form of rows (m, k), the next column in order a pivot where its residual says so.

    Never "the largest first": between equal residuals rounding would choose.
    """
    work = np.array(rows, order="C")
    norms = np.linalg.norm(work, axis=0)
    small = norms <= PIVOT_TOLERANCE * norms.max(initial=0.0)
    dropped = norms[small].max(initial=0.0) / (norms.max(initial=0.0) or 1.0)
    work[:, small] = 0.0
    pivots, taken, left = graded_pivots(work, norms, halving_shares(PIVOT_TOLERANCE))
    is_clear = taken >= CLEAR and max(left, dropped) <= NOISE
    return _back_substituted(work[: len(pivots)], np.array(pivots, dtype=np.int64), is_clear)


def graded_pivots(
    work: NDArray[Any], norms: NDArray[Any], shares: Sequence[float]
) -> tuple[list[int], float, float]:
    """Columns of `work` (m, k) in the order they become pivots, the smallest share at which one did, and the largest
    share left of any other. Turns `work` in place so that its first rows are triangular in them.

    norms   (k,)  the columns' lengths beforehand
    """
    pivots: list[int] = []
    taken = 1.0
    others = np.ones(work.shape[1], dtype=bool)
    for share in shares:
        rest = work[len(pivots) :]
        hopeful = others & (lengths(rest) > 0.5 * share * norms)
        for column in np.flatnonzero(hopeful).tolist():
            residual = np.linalg.norm(work[len(pivots) :, column])
            if residual > share * norms[column]:
                _reflect(work[len(pivots) :], column, residual)
                pivots.append(column)
                others[column] = False
                taken = share
        if len(pivots) == len(work):
            break
    left = lengths(work[len(pivots) :]) / np.where(norms > 0, norms, 1.0)
    return pivots, taken, float(left[others].max(initial=0.0))


def lengths(rows: NDArray[Any]) -> NDArray[Any]:
    """(k,) lengths of the columns of (m, k) rows, in their precision and without BLAS."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->j", rows, rows)))


def _reflect(rows: NDArray[Any], column: int, length: Any) -> None:
    """Turn the rows, in place, so that the column keeps its first entry only (Householder). Rows that the column does
    not reach stay as they are: a long chain's rows are zero for all links before their own.

    einsum and no BLAS: its sums do not hang on the number of threads.
    """
    mirror = rows[:, column].copy()
    mirror[0] += np.copysign(length, mirror[0])
    mirror /= np.linalg.norm(mirror)
    used = np.flatnonzero(mirror)
    if len(used) == len(mirror):
        rows -= np.outer(mirror, 2.0 * np.einsum("i,ij->j", mirror, rows))
        return
    part, mirror = rows[used], mirror[used]
    rows[used] = part - np.outer(mirror, 2.0 * np.einsum("i,ij->j", mirror, part))


def _back_substituted(rows: Array, pivots: NDArray[np.int64], is_clear: bool) -> Reduction:
    echelon = np.zeros(rows.shape)
    if len(pivots):
        echelon[:] = solve_triangular(rows[:, pivots], rows)
    largest = np.abs(echelon).max(axis=1, keepdims=True, initial=0.0)
    echelon[np.abs(echelon) < ECHELON_TOLERANCE * largest] = 0.0
    echelon[:, pivots] = np.eye(len(pivots))
    order = np.argsort(pivots)
    return Reduction(pivots[order], echelon[order], is_clear)
