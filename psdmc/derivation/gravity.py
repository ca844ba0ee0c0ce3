"""Gravity terms: the derivative of a potential that is of first order in every joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.derivation.inertia import Moving, coefficients, column, expanded, moving
from psdmc.derivation.interpolate import linear_sizes
from psdmc.derivation.monomials import Monomials
from psdmc.derivation.terms import Array, Terms, joined, summed
from psdmc.derivation.velocity import derivative
from psdmc.dynamics.frames import BASE, Frame
from psdmc.dynamics.kinematics import path_to
from psdmc.dynamics.regressor import Placed, carried, twist_in
from psdmc.dynamics.scalar import ZERO, Scalar, Vector, dot
from psdmc.robot.mechanism import PARAMETERS_PER_LINK


def gravity_terms(
    frames: Sequence[Frame],
    link_frames: Sequence[Placed],
    up: Vector,
    monomials: Monomials,
    tolerance: float,
) -> Terms:
    """Torque terms per unit of |g|; `up` is the unit vector against gravity in the base frame.

    The potential of a unit mass at r in a link's frame is direction . r + height; both are carried outward from joint
    to joint. The coefficient of a link's mass is the height; those of mx, my, mz are the direction.
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
