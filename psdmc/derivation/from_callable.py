"""Derives the matrices E, P and B of a model from a user's own torque function by sampling, as PSDM-2021 does.

The function's torques must be the inverse dynamics of a serial chain, linear in its parameters. The gravity terms are
of first degree in every joint's sine and cosine (or position), the others of second. Each term is sampled on a grid
with several positions of every joint, and interpolated joint by joint. The cost grows as 5^n with the number of joints
n, so the method suits robots of a few joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.base_parameters import Reduction, reduced
from psdmc.derivation.expand import COEFFICIENT_TOLERANCE, assembled
from psdmc.derivation.interpolate import along_axes, interpolation, nodes, quadratic_sizes
from psdmc.derivation.memory import available_memory, largest_monomial_count, refuse_beyond
from psdmc.derivation.monomials import Monomials, Terms, joined, selected
from psdmc.errors import InputError
from psdmc.model.expansion import RowBlocks
from psdmc.robot.joints import JOINT_TYPES
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Array

TorqueFunction = Callable[[Array, Array, Array, Array, float], Array]

PROBE_SEED = 1_907
PROBE_TOLERANCE = 1e-9
"""Relative error up to which the finished model must reproduce the function at random states."""

PROBES = 32

BLOCK_ROWS = 8192
"""Rows reduced at once, so that the whole stack is never held as a dense matrix."""


@dataclass(frozen=True, slots=True, eq=False)
class SampledModel:
    """A user's torque function in the form tau[i] = y(q, qd, qdd) @ P[i] @ B @ X, with parameters X (k,).

    The monomials y (p,) are products of joint variables.

    E            (5n, p) uint8, exponents of the monomials; monomials without rates also contain gravity_scale
    P            n matrices (p, l), coefficients of the monomials for each base parameter
    B            (l, k) base parameters from the function's parameters X
    parameters   k names of the parameters
    pivots       (l,) for each base parameter, the first parameter in its combination, which has the factor one
    certificate  (n,) largest error of the torques at random states, relative to the joint's largest torque
    """

    E: NDArray[np.uint8]
    P: tuple[sparse.csr_array, ...]
    B: Array
    parameters: tuple[str, ...]
    pivots: tuple[int, ...]
    certificate: Array

    def torques(self, q: Array, qd: Array, qdd: Array, X: Array, gravity_scale: float = 1.0) -> Array:
        """Compute the torques (states, n) from q, qd and qdd, (states, n) each, and parameters (k,)."""
        n = len(self.P)
        rows = np.concatenate([q.T, np.sin(q).T, np.cos(q).T, qd.T, qdd.T])
        strength = np.where(self.E[RowBlocks.of(n).rates].any(axis=0), 1.0, gravity_scale)
        values = strength[:, None] * np.prod(rows[:, None, :] ** self.E[:, :, None], axis=0)
        theta = self.B @ X
        return np.stack([(matrix @ theta) @ values for matrix in self.P], axis=1)


def derive_from_callable(
    f: TorqueFunction,
    kinds: Sequence[str],
    parameter_names: Sequence[str],
    *,
    vectorised: bool = False,
    length: float = 1.0,
    memory: int | None = None,
) -> SampledModel:
    """Derive exponents E, coefficients P and base parameters B X of a torque function tau = f(q, qd, qdd, X,
    gravity_scale).

    f                function of q, qd, qdd (n,), parameters X (k,), in which it is linear, and gravity_scale, by which
                     it multiplies gravity; returns torques (n,). With `vectorised`, q, qd, qdd and the torques are (m,
                     n) for m states
    kinds            "revolute" or "prismatic" for each of n joints, base to tip
    parameter_names  k names, in the order of X. Earlier parameters are preferred as the leading ones of base parameters
    length           m, the robot's size: prismatic joints are sampled at -length, 0 and length
    memory           bytes that the samples may take; default: most of the machine's free memory

    Raises InputError if f returns another shape or is not the inverse dynamics of a serial chain. Raises
    DerivationError if the samples exceed the memory.
    """
    unknown = [kind for kind in kinds if kind not in JOINT_TYPES]
    if unknown:
        raise InputError(f"joint type {shown(unknown[0])} is not known", f"one of {', '.join(JOINT_TYPES)}")
    types = tuple(JOINT_TYPES[kind] for kind in kinds)
    monomials = Monomials(types)
    names = tuple(parameter_names)
    cells = int(np.prod(quadratic_sizes(types), dtype=np.int64))
    needed = cells * monomials.n * len(names) * 8 * 6
    refuse_beyond(
        needed, available_memory() if memory is None else memory, largest_monomial_count(types), monomials.n
    )
    sample = _Sampler(f, monomials, len(names), vectorised, length)
    terms = joined(list(_all_terms(sample)))
    reduction = reduced(row_space(terms, len(names)))
    pivots = _restricted(terms, reduction.pivots)
    E, P = assembled(pivots, monomials, np.ones(len(reduction.pivots)), 1.0)
    return _certified(E, P, reduction, names, sample)


@dataclass(frozen=True, slots=True)
class _Sampler:
    f: TorqueFunction
    monomials: Monomials
    parameters: int
    vectorised: bool
    length: float

    def grid(self) -> Array:
        """(cells, n) all combinations of the joints' sampled positions; the first joint varies slowest."""
        axes = [nodes(joint) * self.length**joint.length_order for joint in self.monomials.types]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, self.monomials.n)

    def torques(self, q: Array, qd: Array, qdd: Array, X: Array, gravity_scale: float) -> Array:
        """Return the torques (m, n) of the user's function at m states q, qd, qdd (m, n)."""
        if self.vectorised:
            values = np.asarray(self.f(q, qd, qdd, X, gravity_scale), dtype=np.float64)
        else:
            each = [self.f(*state, X, gravity_scale) for state in zip(q, qd, qdd, strict=True)]
            values = np.array(each, dtype=np.float64)
        if values.shape != q.shape or not np.isfinite(values).all():
            raise InputError(
                f"the torque function returned shape {values.shape}, expected {q.shape} of finite numbers",
                "f(q, qd, qdd, X, gravity_scale) returns one torque per joint",
            )
        return values

    def per_parameter(self, qd: Array, qdd: Array, gravity_scale: float) -> Array:
        """Return the torques (parameters, n, cells) of n joints for each parameter alone, at all sampled positions
        (cells).

        qd, qdd  (n,) speeds and accelerations, which are equal at all positions
        """
        q = self.grid()
        speeds, accelerations = np.broadcast_to(qd, q.shape), np.broadcast_to(qdd, q.shape)
        return np.stack(
            [
                self.torques(q, speeds, accelerations, unit, gravity_scale).T
                for unit in np.eye(self.parameters)
            ]
        )

    def terms(self, values: Array, rate: int) -> Terms:
        """Return the products of joint variables and their coefficients that interpolate given torques at the sampled
        positions.

        values  (parameters, n, cells) torques for each parameter alone
        rate    number of the product of joint rates that these torques contain
        """
        types = self.monomials.types
        joints, sizes = range(len(types)), quadratic_sizes(types)
        batch = values.reshape(-1, values.shape[-1])
        flat = along_axes([interpolation(joint) for joint in types], np.ascontiguousarray(batch.T))
        found: Array = flat.reshape(values.shape)
        largest = np.abs(found).max(initial=0.0)
        column, row, place = np.nonzero(np.abs(found) > COEFFICIENT_TOLERANCE * max(1.0, largest))
        codes = self.monomials.tensor_codes(joints, sizes)[place] + rate * self.monomials.codes
        in_metres = np.ones(found.shape[-1])
        for j, joint in enumerate(types):
            digits = self.monomials.digit(self.monomials.tensor_codes(joints, sizes), j)
            in_metres /= self.length ** (joint.length_order * digits)
        return Terms(row, codes, column, found[column, row, place] * in_metres[place])


def _all_terms(sample: _Sampler) -> Iterator[Terms]:
    """Terms of gravity, then of accelerations, squares of rates, products of rates."""
    n, monomials = sample.monomials.n, sample.monomials
    rest, units = np.zeros(n), np.eye(n)
    yield sample.terms(sample.per_parameter(rest, rest, 1.0), 0)
    for j in range(n):
        yield sample.terms(sample.per_parameter(rest, units[j], 0.0), monomials.acceleration_rate(j))
    squares = [sample.per_parameter(units[j], rest, 0.0) for j in range(n)]
    for j in range(n):
        yield sample.terms(squares[j], monomials.velocity_rate(j, j))
    for j in range(n):
        for k in range(j + 1, n):
            both = sample.per_parameter(units[j] + units[k], rest, 0.0)
            yield sample.terms(both - squares[j] - squares[k], monomials.velocity_rate(j, k))


def row_space(terms: Terms, columns: int) -> Array:
    """Return the triangular factor R (k, k) of a tall matrix A with k columns of torque coefficients: R^T R = A^T A.

    A has one row for each torque row and monomial of the terms. It is factorized block by block, so it need not fit
    into memory.
    """
    factor: Array = np.zeros((0, columns))
    if not len(terms.value):
        return factor
    key = terms.row * (int(terms.monomial.max()) + 1) + terms.monomial
    _, place = np.unique(key, return_inverse=True)
    order = np.argsort(place, kind="stable")
    place, column, value = place[order], terms.column[order], terms.value[order]
    for start in range(0, int(place[-1]) + 1, BLOCK_ROWS):
        first, last = np.searchsorted(place, [start, start + BLOCK_ROWS])
        rows = np.zeros((int(place[last - 1]) + 1 - start, columns))
        np.add.at(rows, (place[first:last] - start, column[first:last]), value[first:last])
        factor = np.asarray(np.linalg.qr(np.vstack([factor, rows]), mode="r"))
    return factor


def _restricted(terms: Terms, columns: NDArray[np.int64]) -> Terms:
    """Return the terms of the given columns only, renumbered in the order given."""
    number = np.full(int(max(terms.column.max(initial=0), columns.max(initial=0))) + 1, -1)
    number[columns] = np.arange(len(columns))
    place = number[terms.column]
    return selected(terms._replace(column=place), place >= 0)


def _certified(
    E: NDArray[np.uint8],
    P: tuple[sparse.csr_array, ...],
    reduction: Reduction,
    names: tuple[str, ...],
    sample: _Sampler,
) -> SampledModel:
    """The model, after a comparison with the function at random states and parameters; InputError where they differ."""
    pivots = tuple(int(pivot) for pivot in reduction.pivots)
    model = SampledModel(E, P, reduction.echelon, names, pivots, np.zeros(len(P)))
    rng = np.random.default_rng(PROBE_SEED)
    q, qd, qdd = rng.uniform(-2.0, 2.0, size=(3, PROBES, len(P)))
    X = rng.normal(size=len(names))
    expected = sample.torques(q, qd, qdd, X, 1.0)
    largest = np.abs(expected).max(axis=0)
    errors = np.abs(model.torques(q, qd, qdd, X) - expected).max(axis=0)
    errors = errors / np.where(largest > 0, largest, 1.0)
    worst = int(np.argmax(errors))
    if not errors[worst] <= PROBE_TOLERANCE:
        raise InputError(
            f"torque {worst + 1} of the function is no rigid-body torque: its model is off by "
            f"{errors[worst]:.2g} of its largest",
            "it must be linear in X, quadratic in qd, linear in qdd, and leave friction and motors out",
        )
    return SampledModel(E, P, reduction.echelon, names, pivots, errors)
