"""Products of polynomials in the joint variables: evaluated on a tensor grid, multiplied, interpolated axis by axis.

Each joint type has a basis (robot/joints/basis.py). It contains the factors of polynomials of degree one, such as {1,
s, c} or {1, q}, and those of their products, such as {1, s, c, s c, c^2} or {1, q, q^2}, with s = sin q and c = cos q.
The search space is the tensor product over the joints. PSDM-2021 solves one dense system for the coefficients. Here
this system is a Kronecker product, so one small inverse along each axis is enough.
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
    """For each joint, the number of basis factors for polynomials of degree one."""
    return [joint.basis.linear for joint in joints]


def quadratic_sizes(joints: Iterable[JointType]) -> list[int]:
    """For each joint, the number of basis factors for polynomials of degree two."""
    return [joint.basis.size for joint in joints]


def nodes(joint: JointType) -> Array:
    """The values of q at which products are sampled, for a joint with this basis."""
    return np.array(joint.basis.nodes)


def quadratic_basis(joint: JointType, q: Array) -> Array:
    """Evaluate the factors of degree two of a joint's basis at each q: (len(q), size)."""
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
    """(size, linear) matrix that computes the values at the nodes from coefficients of degree one."""
    return quadratic_basis(joint, nodes(joint).astype(precision))[:, : joint.basis.linear]


@cache
def interpolation(joint: JointType, precision: np.dtype[Any] = DOUBLE) -> Array:
    """(size, size) matrix that computes coefficients of degree two from the values at the nodes."""
    found = inverse(quadratic_basis(joint, nodes(joint).astype(np.longdouble))).astype(precision)
    return np.where(np.abs(found) < LAST_DIGIT, 0.0, found) if precision == DOUBLE else found


def along_axes(matrices: Sequence[Array], values: Array) -> Array:
    """Multiply an array by one matrix along each of its axes except the last.

    values   (d_1 ... d_m, batch) as any shape with that many entries in that order
    returns  (batch, e_1 ... e_m) flattened to (batch, e_1 * ... * e_m), matrices[a] being (e_a, d_a)

    Each step takes the first axis and puts its result last. Half of the matrices' entries are zero and are skipped.
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
