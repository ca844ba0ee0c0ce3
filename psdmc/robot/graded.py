"""Chooses independent columns of a matrix, in a given order if possible (QR with column pivoting). Columns that nearly
depend on the others come last.

The result is the same on every processor and in each precision of the matrix. The residual of a column is the part that
is independent of the columns chosen before. If residuals are equal, the order of the columns decides and not rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.reproducible import combined, lengths


def halving_shares(last: float) -> tuple[float, ...]:
    """Return the thresholds 1/2, 1/4, ... down to `last`, with which `graded_pivots` chooses columns.

    For each threshold the columns are examined in their order. A column is chosen (becomes a pivot) if its residual
    exceeds this share of its length. The residual is the part that is independent of the columns chosen before. With
    `last` as the only threshold, divisors could be small although larger ones exist.
    """
    count = math.ceil(-math.log2(last))
    return (*(0.5**k for k in range(1, count)), last)


def graded_pivots(
    work: NDArray[Any], norms: NDArray[Any], shares: Sequence[float], groups: NDArray[Any] | None = None
) -> tuple[list[int], float, float]:
    """Choose independent columns of `work` (m, k), as the module describes. Return their order, the smallest threshold
    that was needed, and the largest residual of the other columns.

    A residual is the length of the part that is independent of the chosen columns, as a share of the column's length.
    `work` is changed in place: its first rows become triangular in the chosen columns.

    norms   (k,)  the columns' lengths before the call
    shares        decreasing thresholds, as from `halving_shares`
    groups  (k,)  ascending numbers of groups. All thresholds are applied to one group before the next group; None: one
            group
    """
    pivots: list[int] = []
    taken = 1.0
    others = np.ones(work.shape[1], dtype=bool)
    group = np.zeros(work.shape[1], dtype=np.int64) if groups is None else groups
    for own in np.unique(group):
        columns, measured = np.flatnonzero(group == own), -1
        for share in shares:
            if len(pivots) == len(work):
                break
            if measured != len(pivots):
                columns, measured = columns[others[columns]], len(pivots)
                residuals = lengths(work[measured:, columns])
            for column in columns[residuals > 0.5 * share * norms[columns]].tolist():
                residual = lengths(work[len(pivots) :, column, None])[0]
                if residual > share * norms[column]:
                    _reflect(work[len(pivots) :], column, residual)
                    pivots.append(column)
                    others[column] = False
                    taken = share
    left = lengths(work[len(pivots) :]) / np.where(norms > 0, norms, 1.0)
    return pivots, taken, float(left[others].max(initial=0.0))


def _reflect(rows: NDArray[Any], column: int, length: Any) -> None:
    """Reflect the rows, in place, so that the column keeps its first entry only (Householder). Rows in which the column
    is zero stay as they are: a long chain's rows are zero for all links before their own. So do columns at right angles
    to the mirror: other branches'.
    """
    mirror = rows[:, column].copy()
    mirror[0] += np.copysign(length, mirror[0])
    mirror /= lengths(mirror[:, None])
    used = np.flatnonzero(mirror)
    if len(used) == len(mirror):
        rows -= np.outer(mirror, 2.0 * combined(mirror, rows))
        return
    part, mirror = rows[used], mirror[used]
    first = int(np.argmax(part.any(axis=0)))
    weights = 2.0 * combined(mirror, part[:, first:])
    turned = np.flatnonzero(weights)
    columns = first + turned
    rows[np.ix_(used, columns)] = part[:, columns] - np.outer(mirror, weights[turned])
