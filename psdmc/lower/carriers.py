"""Carriers: a few link parameters that give the same torques as all of the model's, every other one being exactly zero.

Infinitely many link parameters give the same torques. Any set of parameters whose regressor columns form a basis of all
columns can carry a model. Such sets are the bases of a matroid, so that the greedy choice by weight has the least total
weight. What a parameter costs depends on its neighbours, so that a search by PROGRAM cost refines the choice
(lower/search.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np

from psdmc.dynamics.body import Body
from psdmc.dynamics.following import any_follows
from psdmc.dynamics.parameters import joint_frame_map
from psdmc.dynamics.regressor import regressor
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.slices import first_rates, neutral, normalized
from psdmc.dynamics.torque_rows import torque_rows
from psdmc.lower.reframe import Reframed
from psdmc.lower.tableau import Long, Tableau
from psdmc.robot.graded import graded_pivots, halving_shares, lengths
from psdmc.robot.mechanism import BODY_PARAMETERS, DRIVE, PARAMETERS_PER_LINK, Array, Placement
from psdmc.robot.small import times

PSEUDO_NAMES = ("m", "hx", "hy", "hz", "xx", "yy", "zz", "xy", "xz", "yz", "Im")
"""A link's parameters in pseudo-inertia form, in the order of carriers."""

LENGTH_ORDER = (0, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2)
"""Exponent of the metre in the unit of each parameter. The drive inertia of a sliding joint is kg and is treated apart."""

WEIGHTS = {
    "m": 6.0,
    "hx": 10.0,
    "hy": 10.1,
    "hz": 10.2,
    "xx": 4.0,
    "yy": 4.1,
    "zz": 4.2,
    "xy": 6.0,
    "xz": 6.1,
    "yz": 6.2,
    "Im": 1.0,
}
"""Operations that a parameter adds to Newton-Euler, roughly. Weights of the search's start."""

INDEPENDENT = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12)
"""Part of a column's length that must be left beside the columns already chosen for it to count as independent: the
first figure first, then, for places that are still open, the next. A carrier that is barely independent would have
huge values."""

EXACT = 3e-14
"""Contributions below this, relative to the whole, are rounding of an exact zero."""

FAIR_SHARE = 1e-3
"""Exchanges that would multiply the carriers' values by more than the inverse of this are not considered."""

FAIR_GROWTH = 1e3
"""Largest ratio of the carriers' values to theta_b, lengths in the chain's unit. Where it is exceeded the carriers are
chosen more carefully: nearly parallel axes make columns that are small or nearly equal, and differences of large
values lose digits in double."""

MISS = 1e-13
"""Largest part of a column of the model that carriers may leave unexplained, as a share of the longest column. Rounding
leaves 1e-15; where more is left, the rank of the columns was decided wrongly."""

EFFECT = 1e-15
"""Smallest part that a carrier must add in the careful choice, as a share of the longest column, lengths in the chain's
unit."""

RANK = 1e-12
"""Smallest part that makes a column independent, as a share of the longest one, all columns brought to the same length.
See MISS."""

SAMPLED_JOINTS = 10
"""Robots with more joints are not sampled as a whole, unless joints follow others: what their summed torques depend on is
not found joint by joint."""

STATES = 48
SEED = 20211


def pseudo_map() -> Array:
    """(11, 11): standard parameters of one link to its pseudo-inertia form, about the same frame."""
    matrix = np.zeros((11, 11))
    matrix[:4, :4] = np.eye(4)
    for row, inertia in enumerate((4, 6, 9), start=4):
        matrix[row, [4, 6, 9]] = 0.5
        matrix[row, inertia] -= 1.0
    for row, off_diagonal in ((7, 5), (8, 7), (9, 8)):
        matrix[row, off_diagonal] = -1.0
    matrix[10, 10] = 1.0
    return matrix


def link_map(place: Placement) -> Array:
    """(11, 11): standard parameters about a link frame to pseudo-inertia form about the joint frame it is placed in."""
    matrix = np.zeros((11, 11))
    matrix[:BODY_PARAMETERS, :BODY_PARAMETERS] = joint_frame_map(place)
    matrix[10, 10] = 1.0
    return np.asarray(times(pseudo_map(), matrix))


class Careful(NamedTuple):
    """Columns that double precision cannot tell apart.

    rows    (r, 11 n + l)  the parameters' and the model's columns
    units   (11 n,)  one unit of each parameter in SI, for a unit of length near the chain's size
    """

    rows: Long
    units: Array

    def lightest(self, weights: Sequence[float]) -> tuple[int, ...]:
        """A basis of little weight, ascending. A column is not taken where its part beside the others is much smaller
        than another column's."""
        count = len(self.units)
        order = np.array(sorted(range(count), key=lambda j: (weights[j], j)))
        work = (self.rows[:, :count] * self.units)[:, order]
        work /= lengths(work).max()
        chosen, _, _ = graded_pivots(work, np.ones(count), halving_shares(EFFECT))
        return tuple(sorted(order[chosen].tolist()))


@dataclass(frozen=True, slots=True, eq=False)
class CarrierSpace:
    """Which sets of link parameters can carry a model, and the values that theta_b gives them.

    r, the rank of all columns; l, the model's base parameters

    columns   (r, 11 n)  regressor columns in pseudo-inertia form about the re-framed joint frames, as coordinates in a
                         basis of their span
    tableau   the same columns in a basis of themselves, followed by the model's l columns, which theta_b weights
    whole     (l,)  lengths of the model's columns
    lengths   (11 n,)  those of `columns`
    careful   the same in extended precision, where columns are nearly dependent; None where none are
    """

    columns: Array
    tableau: Tableau
    whole: Array
    careful: Careful | None = None
    lengths: Array = field(init=False, repr=False)
    _transfers: dict[tuple[int, ...], Array] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "lengths", np.linalg.norm(self.columns, axis=0))

    @property
    def count(self) -> int:
        return int(self.columns.shape[1])

    def lightest(self, weights: Sequence[float]) -> tuple[int, ...]:
        """The basis of least weight, ascending; of equal weights the earlier parameter is taken. Where rounding hides
        the last directions from that order: the basis that the tableau started with."""
        if self.careful is not None:
            return self.careful.lightest(weights)
        chosen = _lightest(self.columns, weights)
        return chosen if len(chosen) == len(self.tableau.basis) else self.tableau.basis

    def exchanges(self, carriers: Sequence[int]) -> list[tuple[int, int]]:
        """Pairs (out, in) whose exchange leaves a basis: in the old basis, the parameter that comes in has a fair share
        of the one that goes out."""
        others = [j for j in range(self.count) if j not in carriers and self.lengths[j]]
        share = np.abs(self._coordinates(carriers, others)) * self.lengths[list(carriers), None]
        fair = np.argwhere((share > FAIR_SHARE * self.lengths[others]).T)
        return [(carriers[row], others[column]) for column, row in fair.tolist()]

    def transfer(self, carriers: Sequence[int]) -> Array:
        """(len(carriers), l): theta_b to the carriers' values, with exact zeros and ones.

        An entry is zero where its contribution is rounding, compared with what the base parameter contributes as a
        whole.
        """
        key = tuple(carriers)
        if key not in self._transfers:
            self._transfers[key] = self._transfer(key)
        return self._transfers[key]

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


def carrier_space(reframed: Reframed, representative: Array) -> CarrierSpace:
    """The carriers' space of a model. `representative` takes theta_b to standard parameters about the link frames."""
    n = len(reframed.frames)
    is_sampled = n <= SAMPLED_JOINTS or any_follows(reframed.frames)
    samples = _sampled_columns(reframed) if is_sampled else _torque_rows(reframed)
    lift = _lifted(reframed, representative)
    unused_drives = [
        j for j in range(DRIVE, PARAMETERS_PER_LINK * n, PARAMETERS_PER_LINK) if not np.any(lift[j])
    ]
    samples[:, unused_drives] = 0.0
    columns = samples.astype(np.float64)
    scale = np.linalg.norm(columns, axis=0)
    scale[scale < 1e-12 * np.max(scale)] = 1.0
    compact = _in_their_span(columns / scale) * scale
    rank = len(compact)
    compact[:, np.linalg.norm(columns, axis=0) < 1e-12 * np.max(scale)] = 0.0
    basis = _lightest(compact, [1.0] * compact.shape[1])
    target = _combined(samples, lift)
    whole = np.linalg.norm(target.astype(np.float64), axis=0)
    both = np.hstack([samples, target])
    space = CarrierSpace(compact, Tableau.of(both, basis), whole)
    units = _units(reframed, representative)
    if rank >= len(whole) and _is_fair(space, samples, target, units):
        return space
    return _careful_space(samples, target, units[0])


def every_parameter(reframed: Reframed, representative: Array) -> tuple[tuple[int, ...], Array]:
    """All link parameters that theta_b has a part in, and (count, l) theta_b to their values: more than carriers would be,
    but none of them stands for another, whatever its size."""
    lift = _lifted(reframed, representative).astype(np.float64)
    reached = np.flatnonzero(lift.any(axis=1))
    return tuple(reached.tolist()), lift[reached]


def _lifted(reframed: Reframed, representative: Array) -> Long:
    """(11 n, l) theta_b to link parameters in pseudo-inertia form about the re-framed joint frames."""
    lift = np.zeros((PARAMETERS_PER_LINK * len(reframed.frames), representative.shape[1]), np.longdouble)
    for k, place in enumerate(reframed.link_frames):
        rows = slice(PARAMETERS_PER_LINK * k, PARAMETERS_PER_LINK * (k + 1))
        lift[rows] = times(link_map(place).astype(np.longdouble), representative[rows])
    return lift


def _in_their_span(columns: Array) -> Array:
    """(rank, k) coordinates of k columns in an orthonormal basis of their span, by Householder's reflections with
    column pivots. Columns of which less than RANK is left beside the others count as dependent.

    Not LAPACK's: it shares such small matrices among all cores, which takes longer than one core needs.
    """
    rest, order = columns.copy(), np.arange(columns.shape[1])
    rank, least = 0, 0.0
    for j in range(min(columns.shape)):
        squares = np.einsum("ij,ij->j", rest[j:, j:], rest[j:, j:])
        pivot = j + int(np.argmax(squares))
        left = math.sqrt(squares[pivot - j])
        least = least or RANK * left
        if left <= least:
            break
        rest[:, [j, pivot]], order[[j, pivot]] = rest[:, [pivot, j]], order[[pivot, j]]
        normal = rest[j:, j].copy()
        normal[0] += math.copysign(left, normal[0])
        along = np.einsum("i,ij->j", normal, rest[j:, j:]) * (2.0 / np.einsum("i,i", normal, normal))
        rest[j:, j:] -= normal[:, None] * along
        rank = j + 1
    coordinates = np.zeros((rank, len(order)))
    coordinates[:, order] = np.triu(rest[:rank])
    return coordinates


def _combined(columns: Long, weights: Long) -> Long:
    """columns @ weights, added column by column, as few weights are not zero."""
    total = np.zeros((len(columns), weights.shape[1]), columns.dtype)
    for row, column in zip(*np.nonzero(weights), strict=True):
        total[:, column] += columns[:, row] * weights[row, column]
    return total


def _careful_space(samples: Long, target: Long, units: Array) -> CarrierSpace:
    """The space with rank decided in extended precision, on columns in a common unit."""
    count = len(units)
    work = np.hstack([samples * units, target])
    longest = lengths(work[:, :count]).max()
    work /= longest
    limits = np.where(np.arange(work.shape[1]) < count, 1.0, np.inf)
    chosen, _, _ = graded_pivots(work, limits, halving_shares(EFFECT))
    rows = work[: len(chosen)] * longest
    rows[:, :count] /= units
    careful = Careful(rows, units)
    tableau = Tableau.of(rows, careful.lightest([1.0] * count))
    whole = lengths(rows[:, count:]).astype(np.float64)
    return CarrierSpace(rows[:, :count].astype(np.float64), tableau, whole, careful)


def _is_fair(space: CarrierSpace, samples: Long, target: Long, units: tuple[Array, Array]) -> bool:
    """Whether the first choice of carriers gives the model's columns with values that are no large multiples of theta_b
    in the chain's unit."""
    start = list(space.lightest([WEIGHTS[PSEUDO_NAMES[j % PARAMETERS_PER_LINK]] for j in range(space.count)]))
    transfer = space.transfer(start)
    missed = np.abs(_combined(samples[:, start], transfer) - target).max(initial=0.0)
    carriers, parameters = units
    growth = np.abs(transfer * parameters / carriers[start, None]).max(initial=0.0)
    return bool(growth <= FAIR_GROWTH and missed <= MISS * space.whole.max(initial=0.0))


def _units(reframed: Reframed, representative: Array) -> tuple[Array, Array]:
    """One unit of each carrier and of each base parameter in SI, for a unit of length near the chain's size."""
    longest = max(
        math.hypot(*translation)
        for frame, place in zip(reframed.frames, reframed.link_frames, strict=True)
        for translation in (frame.translation, place.translation.tolist())
    )
    unit = 2.0 ** round(math.log2(longest)) if longest > 0 else 1.0
    leads = np.argmax(representative != 0.0, axis=0) % PARAMETERS_PER_LINK
    carriers = np.tile(unit ** np.array(LENGTH_ORDER, dtype=np.float64), len(reframed.frames))
    return carriers, unit ** np.array(LENGTH_ORDER, dtype=np.float64)[leads]


def _lightest(columns: Array, weights: Sequence[float]) -> tuple[int, ...]:
    """The basis of least weight among columns; of equal weights the earlier column is taken."""
    size = {j: np.linalg.norm(columns[:, j]) for j in range(columns.shape[1])}
    order = sorted((j for j in size if size[j] != 0.0), key=lambda j: (weights[j], j))
    chosen: list[int] = []
    rank = columns.shape[0]
    basis = np.zeros((rank, 0))
    for share, j in product(INDEPENDENT, order):
        if len(chosen) == rank:
            break
        if j in chosen:
            continue
        rest = columns[:, j] - basis @ (basis.T @ columns[:, j])
        rest -= basis @ (basis.T @ rest)
        left = np.linalg.norm(rest)
        if left > share * size[j]:
            basis = np.column_stack([basis, rest / left])
            chosen.append(j)
    return tuple(sorted(chosen))


def _torque_rows(reframed: Reframed) -> Long:
    """(r, 11 n) rows that the torques depend on, in pseudo-inertia form, in extended precision: nothing but rank, where
    samples of all joints have thousands of rows."""
    here = [Placement.identity()] * len(reframed.frames)
    rows = torque_rows(reframed.frames, here, reframed.base_acceleration)
    back = np.round(np.linalg.inv(pseudo_map()))  # zeros and ones
    return np.asarray(times(rows.reshape(-1, PARAMETERS_PER_LINK), back).reshape(rows.shape))


def _sampled_columns(reframed: Reframed) -> Long:
    """(STATES nv, 11 n) regressor in pseudo-inertia form at fixed random states, in extended precision."""
    n, nv = len(reframed.frames), first_rates(reframed.frames)[-1]
    nq = len(neutral(reframed.frames))
    drawn = np.random.default_rng(SEED).uniform(-2.0, 2.0, size=(nq + 2 * nv, STATES)).astype(np.longdouble)
    q, qd, qdd = normalized(reframed.frames, drawn[:nq]), drawn[nq : nq + nv], drawn[nq + nv :]
    here = [Placement.identity()] * n
    rows = regressor(
        reframed.frames, here, range(11 * n), list(q), list(qd), list(qdd), reframed.base_acceleration
    )
    standard = np.zeros((nv, STATES, 11 * n), np.longdouble)
    for i, row in enumerate(rows):
        for column, value in row.items():
            standard[i, :, column] = value
    back = np.round(np.linalg.inv(pseudo_map()))  # zeros and ones
    return _combined(standard.reshape(-1, PARAMETERS_PER_LINK), back).reshape(nv * STATES, -1)


def bodies_from_carriers(
    n: int, carriers: Sequence[int], values: Sequence[Scalar], unit: float
) -> tuple[tuple[Body, ...], tuple[Scalar, ...]]:
    """Bodies and drive inertias whose carriers have these values, every other parameter being zero; lengths in units of
    `unit` m."""
    rows: list[list[Scalar]] = [[0.0] * PARAMETERS_PER_LINK for _ in range(n)]
    powers = (2, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0)
    for carrier, value in zip(carriers, values, strict=True):
        link, name = divmod(carrier, PARAMETERS_PER_LINK)
        rows[link][name] = value * unit ** powers[name] if unit != 1.0 else value
    bodies = tuple(
        Body(row[0], (row[1], row[2], row[3]), (row[4], row[5], row[6], row[7], row[8], row[9]))
        for row in rows
    )
    return bodies, tuple(row[10] for row in rows)
