"""Products of polynomials in the joint variables: evaluate on a tensor grid, multiply, interpolate axis by
axis.

A joint's polynomials of degree one have the basis {1, s, c} (revolute, s = sin q, c = cos q) or {1, q}
(prismatic); their products have {1, s, c, s c, c^2} (s^2 = 1 - c^2) or {1, q, q^2}. The search space is the
tensor product over the joints, so what PSDM-2021 solves as one dense system is a Kronecker product: one small
inverse along each axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from psdmc.robot.chain import JointKind
from psdmc.robot.small import times

Array = NDArray[np.float64]

LINEAR_SIZE: dict[JointKind, int] = {"revolute": 3, "prismatic": 2}
QUADRATIC_SIZE: dict[JointKind, int] = {"revolute": 5, "prismatic": 3}
DOUBLE = np.dtype(np.float64)


def nodes(kind: JointKind) -> Array:
    """Where products are sampled: equally spaced on the circle, which conditions the inverse best; or -1, 0,
    1."""
    if kind == "prismatic":
        return np.array([-1.0, 0.0, 1.0])
    return np.array([2.0 * np.pi * k / 5.0 for k in range(5)])


def quadratic_basis(kind: JointKind, q: Array) -> Array:
    """(len(q), 5 or 3) basis functions of degree two at each q."""
    if kind == "prismatic":
        return np.stack([np.ones_like(q), q, q * q], axis=-1)
    s, c = np.sin(q), np.cos(q)
    return np.stack([np.ones_like(q), s, c, s * c, c * c], axis=-1)


@cache
def evaluation(kind: JointKind, precision: np.dtype[Any] = DOUBLE) -> Array:
    """(5, 3) or (3, 2): coefficients of degree one to values at the nodes."""
    return quadratic_basis(kind, nodes(kind).astype(precision))[:, : LINEAR_SIZE[kind]]


@cache
def interpolation(kind: JointKind, precision: np.dtype[Any] = DOUBLE) -> Array:
    """(5, 5) or (3, 3): values at the nodes to coefficients of degree two."""
    inverse: Array = np.asarray(np.linalg.inv(quadratic_basis(kind, nodes(kind))), dtype=np.float64)
    if precision == DOUBLE:
        return inverse
    basis = quadratic_basis(kind, nodes(kind).astype(precision))
    twice = 2.0 * np.eye(len(basis), dtype=precision)
    for _ in range(2):  # each step squares the error
        inverse = times(inverse, twice - times(basis, inverse))
    return inverse


def along_axes(matrices: Sequence[Array], values: Array) -> Array:
    """Apply one matrix along each axis but the last.

    values   (d_1 ... d_m, batch) as any shape with that many entries in that order
    returns  (batch, e_1 ... e_m) flattened to (batch, e_1 * ... * e_m), matrices[a] being (e_a, d_a)

    Each step takes the first axis off and puts its result last, so that every step is one plain matrix
    product.
    """
    for matrix in matrices:
        turned = values.reshape(matrix.shape[1], -1).T
        values = turned @ matrix.T if values.dtype == DOUBLE else times(turned, matrix.T)
    size = int(np.prod([matrix.shape[0] for matrix in matrices], dtype=np.int64))
    return values.reshape(-1, size)
