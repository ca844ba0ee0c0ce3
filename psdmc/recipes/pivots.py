"""Tests for matrices that are singular at some states, from their pivots and inverses."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inverse
from psdmc.program.operations import Op

LOST = 64.0
"""A matrix A is singular if the share of a diagonal entry that its other rows do not explain, 1 / (A_kk (A^-1)_kk), is below
so many roundings: 7.1e-15 in float64, 3.8e-6 in float32. That of arms with too few joints is up to 10 roundings."""


def inverse_and_sign(rows: Sequence[Sequence[Scalar]]) -> tuple[list[list[Scalar]], Scalar]:
    """Return the inverse of a symmetric matrix, and a sign: 1 if the matrix is positive definite, else -1. A matrix
    that is singular within rounding has the sign -1, too.

    Rounding gives a singular matrix pivots of any sign, but its inverse is large, in whatever order it is eliminated.
    The comparison x < x + 1 is false if x is so large that the 1 is lost in rounding. All comparisons with NaN are
    false.
    """
    factors = factorize(rows)
    found, sign = inverse(factors), 1.0
    for k, pivot in enumerate(factors.pivots):
        sign = regular(sign, pivot, rows[k][k], found[k][k])
    return found, sign


def regular(sign: Scalar, pivot: Scalar, entry: Scalar, inverse_entry: Scalar) -> Scalar:
    """Return the given sign, or -1 if the pivot is not positive or the matrix is singular within rounding.

    The test uses one entry of the matrix's diagonal and the same entry of the inverse's diagonal.
    """
    x = LOST * (entry * inverse_entry)
    return Op.SELECT(0.0, pivot, Op.SELECT(x, x + 1.0, sign, -1.0), -1.0)
