"""Products of polynomials in the joint variables: evaluated on a tensor grid, multiplied, interpolated axis by axis.

A joint type's basis (robot/joints/basis.py) has the factors of which its polynomials of degree one are sums, and those
of their products: {1, s, c} and {1, s, c, s c, c^2} (s = sin q, c = cos q), or {1, q} and {1, q, q^2}. The search space
is the tensor product over the joints, so that what PSDM-2021 solves as one dense system is a Kronecker product: one
small inverse along each axis.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.reproducible import cosine, inverse, sine
from psdmc.robot.joints import JointType

Array = NDArray[np.float64]

DOUBLE = np.dtype(np.float64)

LAST_DIGIT = 5e-16
"""Smaller entries of an inverse whose largest is 0.8 come from the rounding of the nodes alone."""


def linear_sizes(joints: Iterable[JointType]) -> list[int]:
    """Number of factors of degree one at most, for each joint."""
    return [joint.basis.linear for joint in joints]


def quadratic_sizes(joints: Iterable[JointType]) -> list[int]:
    """Number of factors of degree two at most, for each joint."""
    return [joint.basis.size for joint in joints]


def nodes(joint: JointType) -> Array:
    """The values of q at which products are sampled."""
    return np.array(joint.basis.nodes)


def quadratic_basis(joint: JointType, q: Array) -> Array:
    """(len(q), size) values of the joint's factors at each q."""
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
    """(size, linear) matrix: coefficients of degree one to values at the nodes."""
    return quadratic_basis(joint, nodes(joint).astype(precision))[:, : joint.basis.linear]


@cache
def interpolation(joint: JointType, precision: np.dtype[Any] = DOUBLE) -> Array:
    """(size, size) matrix: values at the nodes to coefficients of degree two."""
    found = inverse(quadratic_basis(joint, nodes(joint).astype(np.longdouble))).astype(precision)
    return np.where(np.abs(found) < LAST_DIGIT, 0.0, found) if precision == DOUBLE else found


def along_axes(matrices: Sequence[Array], values: Array) -> Array:
    """Apply one matrix along each axis but the last.

    values   (d_1 ... d_m, batch) as any shape with that many entries in that order
    returns  (batch, e_1 ... e_m) flattened to (batch, e_1 * ... * e_m), matrices[a] being (e_a, d_a)

    Each step takes the first axis off and puts its result last. Half of the matrices' entries are zero: they add nothing.
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
