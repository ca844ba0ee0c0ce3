"""The expansion of a robot's inverse dynamics: the matrices E and P, computed from coefficients of polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from psdmc.derivation.base_parameters import Reduction
from psdmc.derivation.coupled import coupled
from psdmc.derivation.interpolate import linear_sizes
from psdmc.derivation.mass_matrix import (
    Moving,
    acceleration_terms,
    coefficients,
    column,
    derivative,
    expanded,
    mass_matrix_terms,
    moving,
    velocity_terms,
)
from psdmc.derivation.memory import (
    available_memory,
    grid_bytes,
    largest_monomial_count,
    refuse_beyond,
    refuse_long,
    types_along_paths,
    velocity_bytes,
)
from psdmc.derivation.monomials import Monomials, Terms, joined, merged, summed, times_matrix
from psdmc.derivation.scaled import (
    Scaled,
    extended,
    has_small_entries,
    is_of_many_scales,
    monomial_units,
    parameter_units,
    torque_units,
)
from psdmc.dynamics.coordinates import has_mimic_joints
from psdmc.dynamics.frames import BASE, Frame
from psdmc.dynamics.kinematics import carried_by, path_to
from psdmc.dynamics.regressor import Placed, carried, twist_in
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, dot
from psdmc.model.expansion import Expansion
from psdmc.progress import Progress
from psdmc.robot.mechanism import PARAMETERS_PER_LINK, Array

COEFFICIENT_TOLERANCE = 1e-12
"""Coefficients below this are zero, lengths in the robot's unit (scaled.py). Six joints with oblique axes have the same
p for every tolerance from 3e-14 to 1e-9; the smallest true coefficient met is 1e-8 (seven such joints)."""

VALUE_NOISE = 1e-14
"""Uncertainty of a coefficient of size one, from rounding; relative for larger ones. Equal coefficients differ by up to
2e-15 (KR6, LBR7), different ones by more than 1e-4 there."""


class Precision(NamedTuple):
    """Rounding errors that the computation of the torque coefficients assumes, with lengths in the robot's unit.

    zero   a coefficient with at most this magnitude counts as an exact zero
    noise  uncertainty of a coefficient of size one; the uncertainty of larger coefficients is proportional to their
           size
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
    """Compute the inverse dynamics as exponents E of products of joint variables, and their coefficients P.

    Raises DerivationError if E and P do not fit into `memory` bytes (default: most of the free memory).
    """
    types = scaled.types
    if precision is not IN_DOUBLE:
        scaled = extended(scaled)
    monomials = Monomials(types)
    available = available_memory() if memory is None else memory
    paths = types_along_paths(types, [frame.parent for frame in scaled.frames])
    most = sum(map(largest_monomial_count, paths))
    refuse_beyond(max(map(grid_bytes, paths)), available, most, len(types))
    progress("mass matrix")
    chosen = scaled.span[:, reduction.pivots]
    of_parameters = mass_matrix_terms(scaled.frames, scaled.link_frames, monomials, precision.zero)
    mass = {
        pair: times_matrix(terms._replace(row=np.zeros_like(terms.row)), chosen, precision.zero)
        for pair, terms in of_parameters.items()
    }
    progress("gravity")
    potential = gravity_terms(scaled.frames, scaled.link_frames, scaled.up, monomials, precision.zero)
    gravity = times_matrix(potential, chosen, precision.zero)
    progress("velocity terms")
    carried = carried_by(scaled.frames)
    count, needed = velocity_bytes(mass, monomials, carried)
    refuse_long(count, paths, len(types))
    refuse_beyond(needed, available, min(count, most), len(types))
    velocity = velocity_terms(mass, monomials, carried, precision.zero)
    progress("reduction matrices")
    terms = joined([gravity, acceleration_terms(mass, monomials), velocity])
    if has_mimic_joints(scaled.frames):
        terms, monomials = coupled(terms, scaled.frames, monomials, precision.zero)
    units = parameter_units(types, scaled.unit)[scaled.leads[reduction.pivots]]
    return Expansion.of(*assembled(terms, monomials, units, scaled.unit, precision.noise))


def precision_for(scaled: Scaled, reduction: Reduction) -> Precision:
    """Return the floating-point precision with which the torque coefficients of a robot must be computed.

    Double precision is enough if no base parameter is nearly dependent on others, and no angle or length is tiny.
    """
    if is_of_many_scales(scaled) and can_be_finest():
        return FINEST
    return IN_DOUBLE if reduction.is_clear and not has_small_entries(scaled) else EXTENDED


def can_be_finest() -> bool:
    """Whether the machine's long doubles have enough digits for the precision FINEST."""
    return bool(np.finfo(np.longdouble).eps < FINEST.zero)


def assembled(
    terms: Terms,
    monomials: Monomials,
    units: Sequence[float] | Array,
    unit: float,
    value_noise: float = VALUE_NOISE,
) -> tuple[NDArray[np.uint8], tuple[sparse.csr_array, ...]]:
    """Return the exponents E and coefficients P in SI units from torque terms whose lengths are in the robot's unit.

    Each term has a product of joint variables (monomial, numbered by its key), a base parameter (column) and a factor.

    units        (l,) one unit of each base parameter in SI
    unit         m, the robot's unit of length
    value_noise  uncertainty of a coefficient of size one; the uncertainty of larger coefficients is proportional to
                 their size
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


# Gravity: the derivative of a potential that is of first order in every joint.
def gravity_terms(
    frames: Sequence[Frame],
    link_frames: Sequence[Placed],
    up: Vector,
    monomials: Monomials,
    tolerance: float,
) -> Terms:
    """Return the terms of the gravity torques, for gravity of strength one and each standard parameter of the links.

    The potential of a unit mass at r in a link's frame is direction . r + height. Both are computed outward from joint
    to joint. The height is the coefficient of the link's mass, the direction that of its first moments mx, my, mz.

    up  unit vector against gravity in the base frame
    """
    parts: list[Terms] = []
    at_base: tuple[Vector, Array] = (
        (np.array([up[0]]), np.array([up[1]]), np.array([up[2]])),
        np.zeros(1),
    )
    found: list[tuple[Vector, Array]] = []
    for k, frame in enumerate(frames):
        before = at_base if frame.parent == BASE else found[frame.parent]
        found.append(_carried(moving(frame), *before))
        path = path_to(frames, k)
        potential = _link_potential(link_frames[k], *found[k], path, monomials, tolerance)
        for i in path:
            slope = derivative(potential, monomials, i)
            parts.append(Terms(np.full_like(slope.row, i), slope.monomial, slope.column, slope.value))
    return summed(joined(parts), tolerance)


def _carried(joint: Moving, direction: Vector, height: Array) -> tuple[Vector, Array]:
    before, count = column(direction), len(height)
    raised: Scalar = height[:, None] + dot(before, joint.state.offset)
    turned, _ = carried(joint.frame, joint.state, (before, ZERO))
    return expanded(turned, count, joint.basis), coefficients(raised, count, joint.basis)


def _link_potential(
    place: Placed,
    direction: Vector,
    height: Array,
    path: Sequence[int],
    monomials: Monomials,
    tolerance: float,
) -> Terms:
    x, y, z = place.translation.tolist()
    about_link, _ = twist_in(place, (direction, ZERO))
    values = np.stack([height + dot(direction, (x, y, z)), *about_link])
    parameter, position = np.nonzero(np.abs(values) > tolerance)
    k = path[-1]
    codes = monomials.tensor_codes(path, linear_sizes(monomials.types[j] for j in path))
    columns = PARAMETERS_PER_LINK * k + parameter
    return Terms(np.full(len(columns), k), codes[position], columns, values[parameter, position])
