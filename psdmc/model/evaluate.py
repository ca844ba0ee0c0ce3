"""Torques, mass matrix and regressor in NumPy. This code is slow and simple; psdmc checks faster code with it.

They are computed from standard parameters by the recursive algorithms of psdmc.dynamics, or from E, P and theta_b. The
time of the former does not depend on the number of monomials of the torques.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from psdmc.dynamics.composite_body import mass_matrix as composite_bodies
from psdmc.dynamics.frames import base_acceleration, frames_of
from psdmc.dynamics.newton_euler import inverse_dynamics as newton_euler
from psdmc.dynamics.parameters import bodies_of, drive_inertia_of
from psdmc.dynamics.regressor import regressor as standard_regressor
from psdmc.dynamics.scalar import Scalar
from psdmc.errors import InputError
from psdmc.model.expansion import Expansion, RowBlocks
from psdmc.real_arrays import real_array
from psdmc.reproducible import cosine, length, sine
from psdmc.robot.coordinates import refuse_other_lengths, units_of
from psdmc.robot.mechanism import Array, Mechanism

if TYPE_CHECKING:
    from scipy import sparse

CHUNK_BYTES = 64 * 2**20
"""Bytes of monomials' values held at once."""
BLOCK_BYTES = 2**18
"""Bytes of monomials' values multiplied at once: a share of a core's own cache."""


def states(chain: Mechanism, **vectors: ArrayLike) -> tuple[tuple[int, ...], list[Array]]:
    """Return the batch shape of the given state vectors q, qd and so on, and each vector as (states, nq) or (states,
    nv) float64. Raises InputError if a shape does not fit, or if values are no real numbers."""
    names = {"nq": chain.q_names, "nv": chain.v_names}
    axes = {name: ("nq",) if name == "q" else ("nv",) for name in vectors}
    arrays = {name: real_array(name, value, axes=axes[name], names=names) for name, value in vectors.items()}
    lengths = {name: chain.nq if name == "q" else chain.nv for name in vectors}
    for name, array in arrays.items():
        n = lengths[name]
        if array.ndim == 0 or array.shape[-1] != n:
            raise InputError(
                f"{name} has shape {array.shape}, expected (..., {n}) for {len(chain)} joints",
                "the last axis runs over " + ", ".join(chain.joint_names),
            )
    if "q" in arrays:
        units = units_of(chain.joints[i].type for i in chain.own_joints)
        refuse_other_lengths("q", arrays["q"], units)
    try:
        shape = np.broadcast_shapes(*(array.shape[:-1] for array in arrays.values()))
    except ValueError as error:
        found = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InputError(f"shapes do not broadcast: {found}", "make leading axes equal or one") from error
    return shape, [
        np.broadcast_to(a, (*shape, lengths[name])).reshape(-1, lengths[name]) for name, a in arrays.items()
    ]


def torques(chain: Mechanism, x: Array, arrays: list[Array]) -> Array:
    """Compute joint torques tau (states, n), N m or N, from the links' parameters (11n,) and q, qd, qdd."""
    q, qd, qdd = (list(array.T) for array in arrays)
    bodies, drives = bodies_of(chain, x), drive_inertia_of(x)
    found = newton_euler(frames_of(chain), bodies, drives, q, qd, qdd, base_acceleration(chain))
    return columns(found, len(arrays[0]))


def mass_matrix(chain: Mechanism, x: Array, q: Array) -> Array:
    """Compute the mass matrix M(q), (states, n, n), from q (states, n) and the links' standard parameters (11n,), by
    the composite-rigid-body algorithm."""
    rows = composite_bodies(frames_of(chain), bodies_of(chain, x), drive_inertia_of(x), list(q.T))
    return np.stack([columns(row, len(q)) for row in rows], axis=1)


def link_regressor(chain: Mechanism, wanted: Sequence[int], arrays: list[Array]) -> Array:
    """Compute the columns `wanted` of the regressor (states, n, wanted) of the links' standard parameters (11n,), at q, qd,
    qdd (states, n)."""
    q, qd, qdd = (list(array.T) for array in arrays)
    placements = [joint.link_frame for joint in chain.joints]
    rows = standard_regressor(
        frames_of(chain), placements, frozenset(wanted), q, qd, qdd, base_acceleration(chain)
    )
    count = len(arrays[0])
    return np.stack([columns([row.get(c, 0.0) for c in wanted], count) for row in rows], axis=1)


def columns(values: Sequence[Scalar], count: int) -> Array:
    """Return an array (count, len(values)) whose columns are the values: numbers, and arrays (count,)."""
    found = np.empty((count, len(values)))
    for i, value in enumerate(values):
        found[:, i] = value
    return found


# From E, P and theta_b.
class _Monomials:
    """The monomials y of an expansion, prepared for evaluation: products of the rows of E, those of gravity times |g|.

    Many monomials have the same part in q, times few other factors: each such part is computed once.
    """

    def __init__(self, expansion: Expansion, chain: Mechanism) -> None:
        rows, exponents = RowBlocks.of(expansion.n), expansion.E
        moving = exponents[rows.rates].any(axis=0)
        self.part, first = _alike(np.vstack([exponents[rows.position], moving]))
        self.parts = exponents[rows.position, first]
        self.strength = np.where(moving, 1.0, length(np.asarray(chain.gravity)))[first]
        self.factors = tuple(_factors(exponents[rows.rates]))

    def values(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Compute the values of all p monomials, (p, states), from q, qd and qdd (states, n). The factors of a monomial
        are multiplied in the order of E's rows."""
        placed = np.repeat(self.strength[:, None], q.shape[0], axis=1)
        for powers, row in zip(self.parts, np.concatenate([q.T, sine(q).T, cosine(q).T]), strict=True):
            for power in (1, 2):
                chosen = powers == power
                if chosen.any():
                    placed[chosen] *= row**power
        rates = np.concatenate([qd.T, qdd.T])
        table = np.concatenate([np.ones((1, q.shape[0])), rates, rates**2])
        values: Array = np.empty((len(self.part), q.shape[0]))
        block = max(1, BLOCK_BYTES // max(1, values.itemsize * q.shape[0]))
        for start in range(0, len(self.part), block):
            rows = slice(start, start + block)
            values[rows] = placed[self.part[rows]]
            for factor in self.factors:
                values[rows] *= table[factor[rows]]
        return values


def _alike(columns: NDArray[np.uint8]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The number of each column's class of equal columns, (p,), and one column of each class."""
    number = np.zeros(columns.shape[1], dtype=np.int64)
    for row in columns:
        _, first, number = np.unique(number * 3 + row, return_index=True, return_inverse=True)
    return number, first


def _factors(exponents: NDArray[np.uint8]) -> Iterator[NDArray[np.intp]]:
    """(p,) arrays: the index among 1, the rates and their squares of each monomial's first factor, then of its second,
    and so on.

    exponents  (2n, p) of qd and qdd, at most 2
    """
    columns, rows = np.nonzero(exponents.T)
    place = np.arange(len(columns)) - np.searchsorted(columns, columns)
    which = 1 + rows + len(exponents) * (exponents[rows, columns].astype(np.intp) - 1)
    for turn in range(int(place.max(initial=-1)) + 1):
        factor = np.zeros(exponents.shape[1], dtype=np.intp)
        factor[columns[place == turn]] = which[place == turn]
        yield factor


def expanded_torques(expansion: Expansion, chain: Mechanism, theta: Array, arrays: list[Array]) -> Array:
    """Compute joint torques tau (states, n), N m or N, from base parameters (l,) and q, qd, qdd (states, n). There are
    n joints."""
    weights = _weights(expansion, theta)
    return _by_chunks(expansion, chain, arrays, lambda y: (weights @ y).T)


def expanded_regressor(expansion: Expansion, chain: Mechanism, arrays: list[Array]) -> Array:
    """Compute the regressor Y (states, n, l), with the torques tau = Y theta_b, at q, qd, qdd (states, n)."""
    transposed = [matrix.T.tocsr() for matrix in expansion.P]

    def rows(y: Array) -> Array:
        return np.stack([matrix @ y for matrix in transposed]).transpose(2, 0, 1)

    return _by_chunks(expansion, chain, arrays, rows)


def expanded_mass_matrix(expansion: Expansion, chain: Mechanism, theta: Array, q: Array) -> Array:
    """Compute the mass matrix M (states, n, n) at q (states, n), for n joints. Column j is the sum of the torques'
    terms with qdd_j, at qdd_j = 1."""
    n, weights = expansion.n, _weights(expansion, theta)
    columns = [np.flatnonzero(row) for row in expansion.E[RowBlocks.of(n).qdd]]
    parts = [weights[:, own] for own in columns]

    def columns_of(y: Array) -> Array:
        return np.stack([part @ y[own] for part, own in zip(parts, columns, strict=True)]).transpose(2, 1, 0)

    return _by_chunks(expansion, chain, [q, np.zeros_like(q), np.ones_like(q)], columns_of)


def _weights(expansion: Expansion, theta: Array) -> sparse.csr_array:
    """(n, p) weight of each monomial in each torque; sparse, as its sums do not depend on the number of threads."""
    from scipy import sparse

    return sparse.csr_array(np.stack([matrix @ theta for matrix in expansion.P]))


def _by_chunks(
    expansion: Expansion, chain: Mechanism, arrays: list[Array], result: Callable[[Array], Array]
) -> Array:
    """result(values of monomials), evaluated for few states at a time and concatenated along the states."""
    count = len(arrays[0])
    size = max(1, CHUNK_BYTES // (8 * max(1, expansion.p)))
    pieces = ([a[start : start + size] for a in arrays] for start in range(0, max(count, 1), size))
    products = _Monomials(expansion, chain)
    return np.concatenate([result(products.values(*piece)) for piece in pieces])
