"""Tests whether matrices in generated code are singular at a state, from pivots (divisors of a factorization) and from
their inverses. Computes least-squares solutions of minimal norm, for matrices of any rank.

Source: Bjorck 1996, Numerical Methods for Least Squares Problems, sections 2.4 (modified Gram-Schmidt) and 2.7 (complete
orthogonal decomposition)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import factorize, inner_product, inverse
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


Row = list[Scalar]

MARGIN = 1.0 / 64.0
"""A row's orthogonal part is kept if its square times this counts in the square of the row. Rounding, divided by the size
of the smallest kept part, is then a 64th of the bound, so it does not make a dependent row look independent."""


class _Orthogonal(NamedTuple):
    """Vectors v_k = q_k + sum over j < k of shares[k][j] q_j, with orthogonal q.

    basis     q; what belongs to dependent vectors is multiplied by 0 wherever it is used
    inverses  1 / |q_k|^2, or 0 if the vector is dependent
    kept      1, or 0 if the vector is dependent
    """

    basis: list[Row]
    inverses: Row
    kept: Row
    shares: list[Row]


def least_squares(rows: Sequence[Row], right: Sequence[Scalar], shift: Scalar) -> Row:
    """Return the x that minimises |A x - b|^2 + shift |x|^2. Of several minima x, return the one with the smallest |x|.

    rows   rows of A, whose entries have no unit
    right  b, an entry per row
    shift  0 or more, without unit

    A row is treated as dependent on the rows before it if its part orthogonal to them is too short: shorter than about
    1e-7 of the row in float64, or 2e-3 in float32. For every rank of A, the code executes the same operations.

    A = L Q, with orthogonal rows of Q. Then y = Q x minimises |L y - b|. L is lower triangular with ones on its diagonal,
    except for a zero column for each dependent row. If there is none, y follows by substitution. To include the shift,
    A is continued by a unit matrix, whose columns have the weight `shift` in inner products.
    """
    count, length = len(rows), len(rows[0])
    whole = [[*row, *_unit(k, count)] for k, row in enumerate(rows)]
    weights = [1.0] * length + [shift] * count
    across = _orthogonal(whole, weights)
    lower = [[*own, keep] for own, keep in zip(across.shares, across.kept, strict=True)]
    columns = [[0.0] * j + [row[j] for row in lower[j:]] for j in range(count)]
    down = _orthogonal(columns[::-1], [1.0] * count, across.kept[::-1])
    rest, y = list(right), []
    for vector, factor in zip(down.basis, down.inverses, strict=True):
        y.append(inner_product(vector, rest) * factor)
        rest = _less(rest, y[-1], vector)
    for k in reversed(range(count)):
        for j, share in enumerate(down.shares[k]):
            y[j] = y[j] - share * y[k]
    x: Row = [0.0] * length
    for vector, factor, value in zip(reversed(across.basis), reversed(across.inverses), y, strict=True):
        x = [entry + value * factor * part for entry, part in zip(x, vector[:length], strict=True)]
    return x


def _orthogonal(vectors: Sequence[Row], weights: Sequence[Scalar], kept: Row | None = None) -> _Orthogonal:
    """Return the vectors' parts orthogonal to those before them. `kept`: which are not dependent, if this is known."""
    found = _Orthogonal([], [], [], [])
    for k, vector in enumerate(vectors):
        own, shares = list(vector), []
        for other, factor in zip(found.basis, found.inverses, strict=True):
            shares.append(_weighted(weights, other, own) * factor)
            own = _less(own, shares[-1], other)
        size = _weighted(weights, own, own)
        if kept is None:
            whole = _weighted(weights, vector, vector)
            more = whole + MARGIN * size
            keep = Op.SELECT(whole, more, 1.0, 0.0)
            size = Op.SELECT(whole, more, size, 1.0)
        else:
            keep = kept[k]
            size = size + (1.0 - keep)
        for values, value in zip(found, (own, keep / size, keep, shares), strict=True):
            values.append(value)
    return found


def _unit(k: int, count: int) -> Row:
    return [1.0 if i == k else 0.0 for i in range(count)]


def _weighted(weights: Sequence[Scalar], a: Row, b: Row) -> Scalar:
    return inner_product([weight * x for weight, x in zip(weights, a, strict=True)], b)


def _less(a: Row, factor: Scalar, b: Row) -> Row:
    """a - factor b"""
    return [x - factor * y for x, y in zip(a, b, strict=True)]
