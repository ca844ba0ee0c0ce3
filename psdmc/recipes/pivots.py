"""Pivots of matrices that are singular at some states."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inverse
from psdmc.program.operations import Op

LOST = 64.0
"""A matrix A is singular if the share of a diagonal entry that its other rows do not explain, 1 / (A_kk (A^-1)_kk), is below
so many roundings: 7.1e-15 in float64, 3.8e-6 in float32. That of arms with too few joints is up to 10 roundings."""


def inverse_and_pivots(rows: Sequence[Sequence[Scalar]]) -> tuple[list[list[Scalar]], list[Scalar]]:
    """The inverse of a symmetric matrix, and its pivots: those of a row that the others explain but for rounding are -1.

    Rounding gives a singular matrix pivots of any sign, but its inverse is large, in whatever order it is eliminated. In
    x < x + 1 the 1 is lost if x is too large for the precision of the code's reals.
    """
    factors = factorize(rows)
    found, pivots = inverse(factors), []
    for k, pivot in enumerate(factors.pivots):
        x = LOST * (rows[k][k] * found[k][k])
        pivots.append(Op.SELECT(x, x + 1.0, pivot, -1.0))
    return found, pivots
