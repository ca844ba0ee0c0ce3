"""Multiplies polynomials in joint variables: evaluates them on a grid of positions, multiplies, and interpolates.

Each joint type has functions that occur in torques, its basis (robot/joints/basis.py). They are the factors of
polynomials of degree one, {1, s, c} or {1, q} with s = sin q and c = cos q. For degree two, they are {1, s, c, s c,
c^2} or {1, q, q^2}. A polynomial in several joints has one coefficient for each choice of one function per joint.
PSDM-2021 solves one dense system for all coefficients. Here this system is a Kronecker product, so one small inverse
for each joint is enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np

from psdmc.reproducible import cosine, inverse, sine
from psdmc.robot.joints import JointType
from psdmc.robot.mechanism import Array

DOUBLE = np.dtype(np.float64)

LAST_DIGIT = 5e-16
"""Smaller entries of an inverse whose largest is 0.8 come from the rounding of the nodes alone."""


def linear_sizes(joints: Iterable[JointType]) -> list[int]:
    """Return, for each joint, the number of functions in polynomials of degree one: 3 (1, sin q, cos q) or 2 (1, q)."""
    return [joint.basis.linear for joint in joints]


def quadratic_sizes(joints: Iterable[JointType]) -> list[int]:
    """Return, for each joint, the number of functions in polynomials of degree two, such as 3 for 1, q, q^2."""
    return [joint.basis.size for joint in joints]


def nodes(joint: JointType) -> Array:
    """Return the values of q at which polynomials in this joint's variable are sampled."""
    return np.array(joint.basis.nodes)


def quadratic_basis(joint: JointType, q: Array) -> Array:
    """Return the values of a joint's basis functions at the joint positions q, in an array (len(q), size).

    The `size` basis functions have a degree of at most two in q, or in sin q and cos q. They are 1, q and q^2 for a
    prismatic joint, and 1, sin q, cos q, sin q cos q and cos^2 q for a revolute joint.
    """
    rows = (q, sine(q), cosine(q))
    return np.stack([_product(powers, rows) for powers in joint.basis.exponents], axis=-1)


def _product(powers: Sequence[int], rows: Sequence[Array]) -> Array:
    value = np.ones_like(rows[0])
    for power, row in zip(powers, rows, strict=True):
        for _ in range(power):
            value = value * row
    return value


@cache
def evaluation(joint: JointType, precision: np.dtype[Any] = DOUBLE) -> Array:
    """Return the matrix (size, linear) that evaluates a joint's degree-one polynomials at the sampled positions.

    It multiplies the `linear` coefficients and returns values at `size` positions.
    """
    return quadratic_basis(joint, nodes(joint).astype(precision))[:, : joint.basis.linear]


@cache
def interpolation(joint: JointType, precision: np.dtype[Any] = DOUBLE) -> Array:
    """Return the matrix (size, size) that interpolates a joint's degree-two polynomials.

    It multiplies values at `size` sampled positions and returns as many coefficients.
    """
    found = inverse(quadratic_basis(joint, nodes(joint).astype(np.longdouble))).astype(precision)
    return np.where(np.abs(found) < LAST_DIGIT, 0.0, found) if precision == DOUBLE else found


def along_axes(matrices: Sequence[Array], values: Array) -> Array:
    """Multiply an array by one matrix along each of its axes except the last. Zeros in the matrices are skipped.

    matrices  matrix a is (e_a, d_a)
    values    (d_1 ... d_m, batch), in any shape with that many entries in that order
    returns   (batch, e_1 ... e_m), with all axes but the first flattened

    Each step takes the first axis of the array and puts its result last.
    """
    for matrix in matrices:
        rows = values.reshape(matrix.shape[1], -1)
        values = np.empty((rows.shape[1], len(matrix)), rows.dtype)
        for place, weights in enumerate(matrix):
            first, *others = np.flatnonzero(weights)
            total = weights[first] * rows[first]
            for k in others:
                total += weights[k] * rows[k]
            values[:, place] = total
    size = int(np.prod([matrix.shape[0] for matrix in matrices], dtype=np.int64))
    return values.reshape(-1, size)
