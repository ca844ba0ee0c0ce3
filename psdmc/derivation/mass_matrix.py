"""Computes the mass matrix as polynomials in the joint variables, and the torque terms with accelerations and rates.

Each standard parameter of the links is treated separately. The part of M_ij that one parameter of link k contributes
is bilinear in two twists of that link's frame. They are the twists for unit rates of joints i and j, both on the path
from the base to link k, i before j. The twist by joint i is a polynomial of degree one in q (or sin q, cos q) of each
joint after i. The product has degree one in the variables of joints up to j, and degree two in those of joints after j.
Only the latter must be sampled on a grid.

Centrifugal and Coriolis terms follow from the coefficients of the mass matrix: tau_i = sum over j, k of (dM_ij/dq_k -
1/2 dM_jk/dq_i) qd_j qd_k. This is Christoffel's formula before it is made symmetric.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from psdmc.derivation.interpolate import (
    along_axes,
    evaluation,
    interpolation,
    linear_sizes,
    quadratic_sizes,
)
from psdmc.derivation.monomials import Integers, Monomials, Terms, joined, selected, summed
from psdmc.dynamics.frames import BASE, Frame, joint_angle, joint_offset
from psdmc.dynamics.kinematics import path_to
from psdmc.dynamics.motion import JointState
from psdmc.dynamics.regressor import Placed, Twist, carried, twist_in
from psdmc.dynamics.scalar import Scalar, Vector, cross, dot
from psdmc.dynamics.spatial import axis_twist
from psdmc.robot.joints import JointType
from psdmc.robot.joints.basis import Basis
from psdmc.robot.mechanism import DRIVE, PARAMETERS_PER_LINK, Array


@dataclass(frozen=True, slots=True, eq=False)
class FormalAngle:
    """An angle given by arrays of values for its sine and cosine, which need not be those of a real angle.

    The algorithms of psdmc.dynamics use it as a scalar. From such values, coefficients of polynomials in the sine and
    cosine are exact differences (see `formal_coordinate`).
    """

    sine: Array
    cosine: Array

    def sincos(self) -> tuple[Array, Array]:
        return self.sine, self.cosine


class Moving(NamedTuple):
    """One joint at its formal points."""

    basis: Basis
    frame: Frame
    state: JointState


def moving(frame: Frame) -> Moving:
    """Return a joint with its rotation and offset at the values of its coordinate that `formal_coordinate` returns."""
    q = formal_coordinate(frame.joint.basis)
    state = JointState(joint_angle(frame, q).turn(), joint_offset(frame, q))
    return Moving(frame.joint.basis, frame, state)


def formal_coordinate(basis: Basis) -> Scalar:
    """Return values of a joint coordinate from which coefficients of degree-one polynomials are exact differences.

    The polynomial is a sum of the factors 1, sin q and cos q, or 1 and q. At the first value, all factors except 1 are
    zero. At each other value, one further factor is one. No real angle has sine and cosine zero.
    """
    q, sine, cosine = np.array(basis.exponents[: basis.linear], dtype=np.float64).T
    return FormalAngle(sine, cosine) if basis.has_sincos else q


def coefficients(at_points: Scalar, count: int, basis: Basis) -> Array:
    """Return the coefficients (count * linear,) of `count` polynomials of degree one in one joint's variables.

    at_points  their values at the `linear` coordinates that `formal_coordinate` returns
    basis      the factors of the joint, such as 1, sin q, cos q
    """
    found = np.asarray(at_points)
    values = np.broadcast_to(
        np.asarray(found, dtype=np.result_type(found, np.float64)), (count, basis.linear)
    )
    return np.concatenate([values[:, :1], values[:, 1:] - values[:, :1]], axis=1).reshape(-1)


def column(v: Vector) -> Vector:
    """Return a vector's three arrays of coefficients (count,) as (count, 1), so that values of the next joint can vary
    along the new axis."""
    return (v[0][:, None], v[1][:, None], v[2][:, None])


def expanded(v: Vector, count: int, basis: Basis) -> Vector:
    """Return a vector's entries as coefficients of polynomials in one joint's variables, from values of the entries.

    v      three entries, each with values at the coordinates that `formal_coordinate` returns
    count  number of polynomials per entry
    basis  the factors of the joint, such as 1, sin q, cos q
    """
    x, y, z = (coefficients(entry, count, basis) for entry in v)
    return (x, y, z)


def carried_twist(joint: Moving, twist: Twist) -> Twist:
    """Return a twist (linear and angular velocity) in the frame of the next joint, as coefficients of polynomials.

    The polynomials are in the variables of all joints so far, including this joint.
    """
    linear, angular = twist
    moved = carried(joint.frame, joint.state, (column(linear), column(angular)))
    count = len(linear[0])
    return expanded(moved[0], count, joint.basis), expanded(moved[1], count, joint.basis)


def _as_arrays(v: Vector) -> Vector:
    return (np.array([v[0]]), np.array([v[1]]), np.array([v[2]]))


def mass_matrix_terms(
    frames: Sequence[Frame], link_frames: Sequence[Placed], monomials: Monomials, tolerance: float
) -> dict[tuple[int, int], Terms]:
    """Compute the polynomials of the mass matrix entries M_ij, for joints i on the path from the base to joint j.

    Each term has a product of joint functions (monomial, numbered by a code) and a factor for a standard parameter, 11
    per link. Other entries with i < j are zero. Lengths are in a unit near the robot's size. Coefficients with a
    magnitude below `tolerance` are zero.
    """
    paths = [path_to(frames, k) for k in range(len(frames))]
    pairs = sorted((i, j) for j, path in enumerate(paths) for i in path)
    parts: dict[tuple[int, int], list[Terms]] = {pair: [] for pair in pairs}
    twists: list[list[Twist]] = []
    for k, frame in enumerate(frames):
        joint = moving(frame)
        before = [] if frame.parent == BASE else twists[frame.parent]
        linear, angular = axis_twist(frame.joint)
        twists.append(
            [carried_twist(joint, twist) for twist in before] + [(_as_arrays(linear), _as_arrays(angular))]
        )
        seen = [np.stack([*v, *w]) for v, w in (twist_in(link_frames[k], twist) for twist in twists[k])]
        for i, j, found in _link_terms(seen, paths[k], monomials, tolerance):
            parts[i, j].append(found)
        parameter = PARAMETERS_PER_LINK * k + DRIVE
        parts[k, k].append(Terms(np.array([k]), np.array([0]), np.array([parameter]), np.array([1.0])))
    return {pair: joined(found) for pair, found in parts.items()}


def _link_terms(
    twists: Sequence[Array], path: Sequence[int], monomials: Monomials, tolerance: float
) -> Iterator[tuple[int, int, Terms]]:
    """The parts of M_ij by the ten parameters of the link at the path's end; twists[a] is (6, coefficients), of joint
    path[a]."""
    types, k = [monomials.types[joint] for joint in path], path[-1]
    for b in range(len(path)):
        inner = types[b + 1 :]
        second = _at_nodes(twists[b], inner)
        for a in range(b + 1):
            first = _at_nodes(twists[a], inner)
            products = mass_features(first, second)
            found = _interpolated(products, inner)
            sizes = linear_sizes(types[a + 1 : b + 1]) + quadratic_sizes(inner)
            parameter, place = np.nonzero(np.abs(found) > tolerance)
            codes = monomials.tensor_codes(path[a + 1 :], sizes)[place]
            columns = PARAMETERS_PER_LINK * k + parameter
            terms = Terms(np.full(len(codes), k), codes, columns, found[parameter, place])
            yield path[a], path[b], terms


def _at_nodes(twist: Array, inner: Sequence[JointType]) -> Array:
    """(6, outer, nodes): coefficients along the outer joints, values along the inner ones."""
    size = int(np.prod(linear_sizes(inner), dtype=np.int64))
    batch = twist.reshape(-1, size)
    values = along_axes([evaluation(joint, twist.dtype) for joint in inner], np.ascontiguousarray(batch.T))
    return values.reshape(6, -1, values.shape[1])


def _interpolated(products: Array, inner: Sequence[JointType]) -> Array:
    """(10, outer * coefficients) from (10, outer, nodes)."""
    batch = products.reshape(-1, products.shape[-1])
    found = along_axes(
        [interpolation(joint, products.dtype) for joint in inner], np.ascontiguousarray(batch.T)
    )
    return found.reshape(products.shape[0], -1)


def mass_features(first: Array, second: Array) -> Array:
    """Return the factor (10, ...) of each of a body's standard parameters in the mass matrix entry of two twists.

    The standard parameters are mass, first moments and inertia.

    first, second  (6, ...) linear velocity of the frame's origin, and angular velocity, for unit rates of two joints
    """
    v, w = first[:3], first[3:]
    u, o = second[:3], second[3:]
    x, y, z = (a + b for a, b in zip(_crossed(v, o), _crossed(u, w), strict=True))
    return np.stack(
        [
            dot((v[0], v[1], v[2]), (u[0], u[1], u[2])),
            x,
            y,
            z,
            w[0] * o[0],
            w[0] * o[1] + w[1] * o[0],
            w[1] * o[1],
            w[0] * o[2] + w[2] * o[0],
            w[1] * o[2] + w[2] * o[1],
            w[2] * o[2],
        ]
    )


def _crossed(a: Array, b: Array) -> Vector:
    return cross((a[0], a[1], a[2]), (b[0], b[1], b[2]))


def derivative(terms: Terms, monomials: Monomials, joint: int) -> Terms:
    """Return the derivative of mass matrix terms by the position q of one joint.

    A term has a product of functions of q (numbered by its code) and a factor.
    """
    digits = monomials.digit(terms.monomial, joint)
    weight = monomials.weight(joint)
    parts: list[Terms] = []
    for digit, images in enumerate(monomials.types[joint].basis.derivatives):
        chosen = selected(terms, digits == digit) if images else terms
        for image, factor in images:
            moved: Integers = chosen.monomial + (image - digit) * weight
            parts.append(Terms(chosen.row, moved, chosen.column, factor * chosen.value))
    return joined(parts)


def velocity_terms(
    mass_matrix: Mapping[tuple[int, int], Terms],
    monomials: Monomials,
    carried: Sequence[Sequence[int]],
    tolerance: float,
) -> Terms:
    """Return the torque terms with all products of joint rates, from the terms of the mass matrix.

    In the result, the row is the joint, and the monomial includes the rates (its key).

    carried    for each joint, the joints that it moves; its row of the mass matrix depends on no others
    tolerance  largest magnitude of a coefficient that counts as zero
    """
    parts: list[Terms] = []
    for (a, b), terms in mass_matrix.items():
        for d in carried[a]:
            slope = derivative(terms, monomials, d)
            parts.append(_placed(slope, monomials, a, b, d, 1.0))
            if a != b:
                parts.append(_placed(slope, monomials, b, a, d, 1.0))
            parts.append(_placed(slope, monomials, d, a, b, -0.5 if a == b else -1.0))
    return summed(joined(parts), tolerance)


def _placed(slope: Terms, monomials: Monomials, row: int, j: int, k: int, factor: float) -> Terms:
    """A slope as a factor of qd_j qd_k in the torque of joint `row`."""
    key = monomials.velocity_rate(j, k) * monomials.codes
    return Terms(np.full_like(slope.row, row), slope.monomial + key, slope.column, factor * slope.value)


def acceleration_terms(mass_matrix: Mapping[tuple[int, int], Terms], monomials: Monomials) -> Terms:
    """Torque terms of M qdd."""
    parts: list[Terms] = []
    for (a, b), terms in mass_matrix.items():
        for row, j in ((a, b), (b, a))[: 1 if a == b else 2]:
            key = monomials.acceleration_rate(j) * monomials.codes
            parts.append(Terms(np.full_like(terms.row, row), terms.monomial + key, terms.column, terms.value))
    return joined(parts)


def slope_count(terms: Terms, monomials: Monomials, joint: int) -> int:
    """Number of terms that `derivative` makes."""
    images = [len(images) for images in monomials.types[joint].basis.derivatives]
    counts = np.bincount(monomials.digit(terms.monomial, joint), minlength=len(images))
    return int(counts[: len(images)] @ np.array(images))
