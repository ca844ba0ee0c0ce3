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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from psdmc.lower.tableau import Long, Tableau
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
    """The sets of link parameters that can be the carriers of a model, and the carriers' values as functions of
    theta_b. Carriers are the parameters that represent all others in generated code.

    r is the rank of all columns, and l the number of the model's base parameters.

    columns  (r, 11 n)  regressor columns of the link parameters in pseudo-inertia form, about the new joint frames of
                        generated code; they are coordinates in a basis of the columns' span
    tableau  the columns as combinations of a basis among them, followed by the columns of the l base parameters
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
