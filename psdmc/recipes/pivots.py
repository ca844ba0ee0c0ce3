"""Tests whether matrices in generated code are singular at a state, from pivots (divisors of a factorization) and from
their inverses."""

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

    By rounding, the pivots (divisors of the factorization) of a singular matrix can have any sign. So the test also
    uses the size of the inverse. The comparison x < x + 1 is false if x is so large that the 1 is lost in rounding. All
    comparisons with NaN are false.
    """
    factors = factorize(rows)
    found, sign = inverse(factors), 1.0
    for k, pivot in enumerate(factors.pivots):
        sign = regular(sign, pivot, rows[k][k], found[k][k])
    return found, sign


def regular(sign: Scalar, pivot: Scalar, entry: Scalar, inverse_entry: Scalar) -> Scalar:
    """Return `sign` unchanged if a matrix passes the test of one row, else -1. The test fails if the pivot (divisor of
    the factorization) is not positive, or if the matrix is singular within rounding.

    `entry` is the diagonal entry of the matrix, `inverse_entry` that of the inverse.
    """
    x = LOST * (entry * inverse_entry)
    return Op.SELECT(0.0, pivot, Op.SELECT(x, x + 1.0, sign, -1.0), -1.0)
