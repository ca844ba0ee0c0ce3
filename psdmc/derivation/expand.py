"""E, P and the base parameters' equations of a chain, in coefficient space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.extended import extended, has_small_entries, is_of_many_scales
from psdmc.derivation.gravity import gravity_terms
from psdmc.derivation.inertia import mass_matrix_terms
from psdmc.derivation.memory import (
    available_memory,
    grid_bytes,
    largest_monomial_count,
    refuse_beyond,
    refuse_long,
    types_along_ways,
    velocity_bytes,
)
from psdmc.derivation.monomials import Monomials
from psdmc.derivation.reduce import Reduction
from psdmc.derivation.rounding import merged
from psdmc.derivation.terms import Terms, joined, times_matrix
from psdmc.derivation.units import Scaled, monomial_units, parameter_units, torque_units
from psdmc.derivation.velocity import acceleration_terms, velocity_terms
from psdmc.dynamics.kinematics import carried_by
from psdmc.dynamics.scalar import Vector
from psdmc.model.expansion import Expansion
from psdmc.progress import Progress

Array = NDArray[np.float64]

COEFFICIENT_TOLERANCE = 1e-12
"""Coefficients below this are zero, lengths in the robot's unit (units.py). Six joints with oblique axes have the same
p for every tolerance from 3e-14 to 1e-9; the smallest true coefficient met is 1e-8 (seven such joints)."""

VALUE_NOISE = 1e-14
"""Uncertainty of a coefficient of size one, from rounding; relative for larger ones. Equal coefficients differ by up to
2e-15 (KR6, LBR7), different ones by more than 1e-4 there."""


class Precision(NamedTuple):
    """Limits of rounding, lengths in the robot's unit.

    zero   what an exact zero may become
    noise  uncertainty of a coefficient of size one, relative for larger ones
    """

    zero: float
    noise: float


IN_DOUBLE = Precision(COEFFICIENT_TOLERANCE, VALUE_NOISE)
EXTENDED = Precision(1e-15, 1e-16)
"""For nearly dependent columns, where coefficients of size tilt^2 matter. Rounding leaves less than 1e-17 there."""


FINEST = Precision(1e-18, 1e-19)
"""For robots of many scales: the coefficients of a joint whose lengths are 1e-5 of the robot's are 1e-10 of others.
Some coefficients of 1e-18 that are rounding are kept: they add monomials, but cost no digits."""


def expand(
    scaled: Scaled, reduction: Reduction, precision: Precision, progress: Progress, memory: int | None = None
) -> Expansion:
    """E and P; DerivationError where they do not fit into `memory` bytes (default: most of the free memory)."""
    types = scaled.types
    if precision is not IN_DOUBLE:
        scaled = extended(scaled)
    monomials = Monomials(types)
    available = available_memory() if memory is None else memory
    ways = types_along_ways(types, [frame.parent for frame in scaled.frames])
    most = sum(map(largest_monomial_count, ways))
    refuse_beyond(max(map(grid_bytes, ways)), available, most, len(types))
    progress("mass matrix")
    chosen = scaled.span[:, reduction.pivots]
    mass = _mass_matrix(scaled, chosen, monomials, precision.zero)
    progress("gravity")
    gravity = _gravity(scaled, chosen, monomials, precision.zero)
    progress("velocity terms")
    carried = carried_by(scaled.frames)
    count, needed = velocity_bytes(mass, monomials, carried)
    refuse_long(count, ways, len(types))
    refuse_beyond(needed, available, min(count, most), len(types))
    velocity = velocity_terms(mass, monomials, carried, precision.zero)
    progress("reduction matrices")
    terms = joined([gravity, acceleration_terms(mass, monomials), velocity])
    units = parameter_units(types, scaled.unit)[scaled.leads[reduction.pivots]]
    return Expansion.of(*assembled(terms, monomials, units, scaled.unit, precision.noise))


def precision_for(scaled: Scaled, reduction: Reduction) -> Precision:
    """The precision that a chain needs: double where every coefficient is either rounding or far larger."""
    if is_of_many_scales(scaled) and can_be_finest():
        return FINEST
    return IN_DOUBLE if reduction.is_clear and not has_small_entries(scaled) else EXTENDED


def can_be_finest() -> bool:
    """Whether long doubles have the digits for FINEST here."""
    return bool(np.finfo(np.longdouble).eps < FINEST.zero)


def _mass_matrix(
    scaled: Scaled, chosen: Array, monomials: Monomials, zero: float
) -> dict[tuple[int, int], Terms]:
    """The mass matrix's terms in the chosen columns of the span; row 0 throughout."""
    found = mass_matrix_terms(scaled.frames, scaled.link_frames, monomials, zero)
    return {
        pair: times_matrix(terms._replace(row=np.zeros_like(terms.row)), chosen, zero)
        for pair, terms in found.items()
    }


def _gravity(scaled: Scaled, chosen: Array, monomials: Monomials, zero: float) -> Terms:
    up: Vector = scaled.up
    terms = gravity_terms(scaled.frames, scaled.link_frames, up, monomials, zero)
    return times_matrix(terms, chosen, zero)


def assembled(
    terms: Terms,
    monomials: Monomials,
    units: Sequence[float] | Array,
    unit: float,
    value_noise: float = VALUE_NOISE,
) -> tuple[NDArray[np.uint8], tuple[sparse.csr_array, ...]]:
    """E and P in SI from torque terms (monomial: key, column: base parameter) in the robot's unit of length.

    units        (l,) one unit of each base parameter in SI
    value_noise  uncertainty of a coefficient of size one, relative for larger ones
    """
    keys, place = np.unique(terms.monomial, return_inverse=True)
    exponents = monomials.exponents(keys)
    types = monomials.types
    shape = (len(keys), len(units))
    to_si = torque_units(types, unit)[terms.row]
    to_si /= monomial_units(exponents, types, unit)[place] * np.asarray(units)[terms.column]
    noise = value_noise * np.maximum(1.0, np.abs(terms.value)) * to_si
    values = merged((terms.value * to_si).astype(np.float64), noise.astype(np.float64))
    matrices = []
    for joint in range(monomials.n):
        own = np.flatnonzero(terms.row == joint)
        matrix = sparse.csr_array((values[own], (place[own], terms.column[own])), shape=shape)
        matrix.sort_indices()
        matrices.append(matrix)
    return exponents, tuple(matrices)
