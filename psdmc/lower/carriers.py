"""Carriers: a few link parameters that give the same torques as all parameters of the model. All other parameters are
set to exactly zero.

Infinitely many vectors of link parameters give the same torques. Any set of parameters whose regressor columns are a
basis of all columns can be carriers. These sets form a matroid. Therefore the least total weight results if parameters
are taken one by one, the lightest independent one first. The cost of a parameter depends on which other parameters are
nonzero. A search that counts operations therefore refines the choice (lower/search.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.reproducible import lengths
from psdmc.robot.graded import graded_pivots, halving_shares
from psdmc.robot.mechanism import Array

INDEPENDENT = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12)
"""Part of a column's length that must be left beside the columns already chosen for it to count as independent: the
first figure first, then, for places that are still open, the next. A carrier that is barely independent would have
huge values."""

EXACT = 4e-15
"""Contributions below this, relative to the whole, are rounding of an exact zero."""

FAIR_SHARE = 1e-3
"""Exchanges that would multiply the carriers' values by more than the inverse of this are not considered."""

EFFECT = 1e-15
"""Smallest part that a carrier must add in the careful choice, as a share of the longest column, lengths in the chain's
unit."""


class Careful(NamedTuple):
    """Regressor columns that double precision cannot distinguish, in extended precision.

    rows   (r, 11 n + l)  the columns of all link parameters, then those of the model's base parameters
    units  (11 n,)  one unit of each parameter in SI, for a unit of length near the size of the robot
    """

    rows: Long
    units: Array

    def lightest(self, weights: Sequence[float]) -> tuple[int, ...]:
        """Return a basis among the parameters' columns with a small sum of weights, as indices in ascending order. A
        column is not chosen if, after subtraction of the chosen columns, it is much smaller than another column."""
        count = len(self.units)
        order = np.array(sorted(range(count), key=lambda j: (weights[j], j)))
        work = (self.rows[:, :count] * self.units)[:, order]
        work /= lengths(work).max()
        chosen, _, _ = graded_pivots(work, np.ones(count), halving_shares(EFFECT))
        return tuple(sorted(order[chosen].tolist()))


@dataclass(frozen=True, slots=True, eq=False)
class CarrierSpace:
    """Carriers are link parameters that represent all others in generated code; the other parameters are set to zero.
    This class holds the possible sets of carriers of a model with n links. It also computes the carriers' values from
    the l base parameters theta_b.

    The torques are linear in the link parameters, which are in pseudo-inertia form, about the joint frames of generated
    code. The regressor (the matrix of this linear function) has one column per link parameter, and the rank r.

    columns  (r, 11 n)  the regressor's columns, as coordinates in an orthonormal basis of the space that they span
    tableau  the regressor's columns as linear combinations of r of these columns; after them the columns of the base
             parameters, as combinations of the same r columns
    whole    (l,)  lengths of the base parameters' columns
    lengths  (11 n,)  lengths of `columns`
    careful  the columns in extended precision, if some are nearly dependent; else None
    """

    columns: Array
    tableau: Tableau
    whole: Array
    careful: Careful | None = None
    lengths: Array = field(init=False, repr=False)
    _transfers: dict[tuple[int, ...], tuple[tuple[NDArray[np.intp], ...], Array]] = field(
        default_factory=dict, init=False, repr=False
    )
    """What is not zero of each, by its place: of a tree, one entry in fifty."""
    _lightest: dict[tuple[float, ...], tuple[int, ...]] = field(default_factory=dict, init=False, repr=False)
    """Bases by their weights, of which there are two: every function's search begins with the same ones."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "lengths", np.linalg.norm(self.columns, axis=0))

    @property
    def count(self) -> int:
        return int(self.columns.shape[1])

    def lightest(self, weights: Sequence[float]) -> tuple[int, ...]:
        """Return the carriers (parameters that represent all others) with the least sum of weights, as indices in
        ascending order. Of equal weights the earlier parameter is chosen. If rounding makes this basis incomplete,
        return the basis of the tableau."""
        key = tuple(weights)
        if key not in self._lightest:
            self._lightest[key] = self._chosen(key)
        return self._lightest[key]

    def _chosen(self, weights: tuple[float, ...]) -> tuple[int, ...]:
        if self.careful is not None:
            return self.careful.lightest(weights)
        chosen = lightest(self.columns, weights)
        return chosen if len(chosen) == len(self.tableau.basis) else self.tableau.basis

    def exchanges(self, carriers: Sequence[int]) -> list[tuple[int, int]]:
        """Return pairs (out, in): the parameter `in` can take the place of the carrier `out`. The carriers (parameters
        that represent all others) then remain a basis. Pairs that would make the carriers' values too large are left
        out."""
        others = [j for j in range(self.count) if j not in carriers and self.lengths[j]]
        share = np.abs(self._coordinates(carriers, others)) * self.lengths[list(carriers), None]
        fair = np.argwhere((share > FAIR_SHARE * self.lengths[others]).T)
        return [(carriers[row], others[column]) for column, row in fair.tolist()]

    def transfer(self, carriers: Sequence[int]) -> Array:
        """Return the matrix (len(carriers), l) from theta_b to the carriers' values, with exact zeros and ones.

        An entry becomes zero if it is only rounding, compared with the whole effect of the base parameter.
        """
        key = tuple(carriers)
        if key in self._transfers:
            entries, values = self._transfers[key]
            out = np.zeros((len(key), len(self.whole)))
            out[entries] = values
            return out
        out = self._transfer(key)
        entries = np.nonzero(out)
        self._transfers[key] = entries, out[entries]
        return out

    def _transfer(self, carriers: tuple[int, ...]) -> Array:
        out = self._coordinates(carriers, slice(self.count, None))
        rows, columns = np.nonzero(out)
        raw = out[rows, columns]
        contribution = np.abs(raw) * self.lengths[np.array(carriers)[rows]]
        kept = np.where(contribution < EXACT * self.whole[columns], 0.0, raw)
        nearest = np.round(kept)
        is_one = (np.abs(kept - nearest) < EXACT) & (np.abs(nearest) == 1)
        out[rows, columns] = np.where(is_one, nearest, kept)
        return out

    def _coordinates(self, carriers: Sequence[int], wanted: Sequence[int] | slice) -> Array:
        """Some of the columns and of the model's behind them, in the basis of the carriers."""
        if self.careful is not None:  # exchanges would magnify what rounding left of the smallest columns
            return Tableau.of(self.careful.rows, carriers).entries[:, wanted].astype(np.float64)
        return self.tableau.within(carriers, wanted).astype(np.float64)


def lightest(columns: Array, weights: Sequence[float]) -> tuple[int, ...]:
    """Return the indices of a basis among the columns, with the least sum of weights. Of equal weights the earlier
    column is chosen."""
    size = {j: np.linalg.norm(columns[:, j]) for j in range(columns.shape[1])}
    order = sorted((j for j in size if size[j] != 0.0), key=lambda j: (weights[j], j))
    chosen: list[int] = []
    rank = columns.shape[0]
    space = np.zeros((rank, rank), order="F")
    for share, j in product(INDEPENDENT, order):
        if len(chosen) == rank:
            break
        if j in chosen:
            continue
        basis = space[:, : len(chosen)]
        rest = columns[:, j] - basis @ (basis.T @ columns[:, j])
        rest -= basis @ (basis.T @ rest)
        left = np.linalg.norm(rest)
        if left > share * size[j]:
            space[:, len(chosen)] = rest / left
            chosen.append(j)
    return tuple(sorted(chosen))


# Columns as linear combinations of some columns, in extended precision. Exact zeros and ones stay exact.
#
# The results of LAPACK differ in the last digit between processors. It would then depend on the processor which numbers
# are equal. Here every operation is elementwise, in NumPy's longest float. Generated code is therefore equal on every
# x86 processor.


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
