"""Columns of a matrix as linear combinations of some of its columns, in extended precision. Exact zeros and ones stay
exact.

The results of LAPACK differ in the last digit between processors. It would then depend on the processor which numbers
are equal. Here every operation is elementwise, in NumPy's longest float. Generated code is therefore equal on every x86
processor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Long = NDArray[Any]
"""An array of np.longdouble: 64 bits of mantissa on x86, 113 on most Arm, 53 where the C library has no more."""

SPARSE = 3
"""How many times as long an entry takes that is picked by its row and column."""


@dataclass(frozen=True, slots=True, eq=False)
class Tableau:
    """The coordinates of all columns of a matrix in a basis that consists of some of the columns.

    basis    r column indices; row i belongs to basis[i]
    entries  (r, columns) columns = columns[:, basis] @ entries; the basis's columns have unit vectors
    """

    basis: tuple[int, ...]
    entries: Long

    @staticmethod
    def of(columns: Long, basis: Sequence[int]) -> Tableau:
        """Return the coordinates of all columns in the given basis, by Gauss-Jordan elimination with row pivots. The
        columns of the basis must be independent.

        The columns of the basis are eliminated first. Of the other columns, only the rows with pivots are needed, and
        they are computed afterwards.
        """
        inside = set(basis)
        others = [j for j in range(columns.shape[1]) if j not in inside]
        rows, factors = _row_pivots(columns[:, list(basis)])
        rest = columns[rows][:, others]
        for k, factor in enumerate(factors[rows].T):
            behind = rest[k] / factor[k]
            _subtract(rest, factor, behind)
            rest[k] = behind
        entries = np.zeros((len(basis), columns.shape[1]), columns.dtype)
        entries[:, others] = rest
        entries[range(len(basis)), list(basis)] = 1.0
        return Tableau(tuple(basis), entries)

    def within(self, basis: Sequence[int], wanted: Sequence[int] | slice) -> Long:
        """Return the coordinates (r, wanted) of the columns `wanted` in another basis, which also consists of columns
        of the matrix."""
        old, new = set(self.basis), set(basis)
        entering = [j for j in basis if j not in old]
        leaving = [i for i, j in enumerate(self.basis) if j not in new]
        now = list(self.basis)
        entries = np.concatenate([self.entries[:, entering], self.entries[:, wanted]], axis=1)
        places = list(range(len(entering)))
        while places:
            block = np.abs(entries[np.ix_(leaving, places)])
            row, column = divmod(int(np.argmax(block)), len(places))
            i, place = leaving.pop(row), places.pop(column)
            _pivot(entries, i, place)
            now[i] = entering[place]
        row_of = {j: i for i, j in enumerate(now)}
        order = [row_of[j] for j in basis]
        return np.asarray(entries[order, len(entering) :])


def _row_pivots(rest: Long) -> tuple[list[int], Long]:
    """The row that each of r independent columns takes for its pivot, and as columns what every row has of them then.
    Turns `rest` (rows, r) in place."""
    rows: list[int] = []
    for k in range(rest.shape[1]):
        free = np.abs(rest[:, k])
        free[rows] = -1.0
        row = int(np.argmax(free))
        rows.append(row)
        behind = rest[row, k + 1 :] / rest[row, k]
        _subtract(rest[:, k + 1 :], rest[:, k], behind)
        rest[row, k + 1 :] = behind
    return rows, rest


def _subtract(rest: Long, factor: Long, behind: Long) -> None:
    """rest -= factor[:, None] * behind, in place, where neither is zero: a tree's rows are zero in the columns of other
    branches. Zeros would change nothing."""
    used, filled = np.flatnonzero(factor), np.flatnonzero(behind)
    if SPARSE * len(used) * len(filled) > rest.size:
        rest -= factor[:, None] * behind
    else:
        rest[used[:, None], filled] -= factor[used, None] * behind[filled]


def _pivot(entries: Long, row: int, column: int) -> None:
    """Make `column` the unit vector of `row`. Of a tree's columns most have nothing in a row."""
    filled = np.flatnonzero(entries[row])
    behind = entries[row, filled] / entries[row, column]
    entries[row, filled] = behind
    factors = entries[:, column].copy()
    factors[row] = 0.0
    used = np.flatnonzero(factors)
    entries[used[:, None], filled] -= factors[used, None] * behind
    entries[used, column] = 0.0
