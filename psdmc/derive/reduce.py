"""Base parameters: the reduced row echelon form of the coefficients, pivots in the parameters' own order.

Velocity terms are derivatives of the mass matrix in coefficient space, so their coefficients are combinations of its:
mass matrix and gravity alone span the row space.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from psdmc.derive.terms import Terms

Array = NDArray[np.float64]

PIVOT_TOLERANCE = 1e-10
"""A parameter is a new pivot where what earlier pivots leave of its column exceeds this share of the column."""

_BLOCK_ROWS = 8192
"""Rows reduced at once, so that the stack is never held dense as a whole."""


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """Which columns are base parameters, and what they stand for.

    pivots   (l,)     column indices, ascending
    echelon  (l, k)   base parameters = echelon @ columns' parameters; a unit vector at each pivot
    """

    pivots: NDArray[np.int64]
    echelon: Array


def row_space(blocks: Iterable[Terms], columns: int) -> Array:
    """(k, k) triangular factor R of all rows (row, function) of the blocks: R^T R = A^T A, found by blocked QR."""
    factor = np.zeros((0, columns))
    for block in blocks:
        for rows in _dense_rows(block, columns):
            factor = np.linalg.qr(np.vstack([factor, rows]), mode="r")
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


def reduced(factor: Array) -> Reduction:
    """Row echelon form of a matrix by Householder reflections, the next column a pivot where its residual says so.

    Never "the largest first": that choice would hang on rounding.
    """
    work = np.array(factor)
    norms = np.linalg.norm(work, axis=0)
    pivots: list[int] = []
    for column in range(work.shape[1]):
        rank = len(pivots)
        below = work[rank:, column]
        residual = np.linalg.norm(below)
        if residual <= PIVOT_TOLERANCE * norms[column]:
            continue
        mirror = below.copy()
        mirror[0] += np.copysign(residual, mirror[0])
        mirror /= np.linalg.norm(mirror)
        work[rank:] -= 2.0 * np.outer(mirror, mirror @ work[rank:])
        pivots.append(column)
    l = len(pivots)
    echelon = np.zeros((l, work.shape[1]))
    if l:
        echelon = _back_substituted(work[:l], np.array(pivots))
    return Reduction(np.array(pivots, dtype=np.int64), echelon)


def _back_substituted(rows: Array, pivots: NDArray[np.int64]) -> Array:
    echelon: Array = np.linalg.solve(np.triu(rows[:, pivots]), rows)
    echelon[np.abs(echelon) < PIVOT_TOLERANCE] = 0.0
    for rank, pivot in enumerate(pivots):
        echelon[rank, :pivot] = 0.0
        echelon[:, pivot] = 0.0
        echelon[rank, pivot] = 1.0
    return echelon
