"""Sums and products of matrices, factorization of a symmetric positive definite matrix, and solutions from the factors.
Loops run entry by entry, because the entries can be symbols that record operations.

In a mass matrix, an entry of two joints on different branches is zero at every state and is left out. Parents come
before children, and elimination goes from the last row up. Elimination of a joint's row changes an entry of two joints
only if both carry the eliminated joint. Zeros therefore stay zero (Featherstone 2008, section 6.5: branch-induced
sparsity).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from psdmc.dynamics.scalar import Scalar

Rows = tuple[tuple[Scalar, ...], ...]

Matrix = Sequence[Sequence[Scalar]]


class SingularMatrix(Exception):
    """This error says that a pivot of the factorization is not positive at any state.

    `row` is the pivot's row in the matrix. In a mass matrix, the row is the number of a joint rate.
    """

    def __init__(self, row: int) -> None:
        super().__init__(f"pivot {row} is not positive at any state")
        self.row = row


@dataclass(frozen=True, slots=True)
class Factors:
    """The factors of a symmetric matrix M = L^T D L: L is lower triangular with ones on the diagonal, D is diagonal.

    pivots    (n)  D, all positive if M is positive definite
    inverses  (n)  1 / D
    lower     row k: the k entries of L left of the diagonal
    scaled    row k: the k entries of D L left of the diagonal
    """

    pivots: tuple[Scalar, ...]
    inverses: tuple[Scalar, ...]
    lower: Rows
    scaled: Rows


def factorize(matrix: Sequence[Sequence[Scalar]]) -> Factors:
    """Return the factors of M by elimination from the last row up. The composite-rigid-body algorithm computes the rows
    in this order. Raises SingularMatrix if a pivot is a constant, zero or negative."""
    n = len(matrix)
    rows = [list(row) for row in matrix]
    inverses: list[Scalar] = [0.0] * n
    lower: list[list[Scalar]] = [[] for _ in range(n)]
    for k in reversed(range(n)):
        pivot = rows[k][k]
        if isinstance(pivot, float) and pivot <= 0.0:
            raise SingularMatrix(k)
        inverses[k] = 1.0 / pivot
        lower[k] = [0.0] * k
        coupled = _nonzero(rows[k][:k])
        for i in coupled:
            lower[k][i] = rows[k][i] * inverses[k]
            for j in coupled:
                if j > i:
                    break
                rows[i][j] = rows[i][j] - lower[k][i] * rows[k][j]
    return Factors(
        pivots=tuple(rows[k][k] for k in range(n)),
        inverses=tuple(inverses),
        lower=tuple(tuple(row) for row in lower),
        scaled=tuple(tuple(rows[k][:k]) for k in range(n)),
    )


def _nonzero(row: Sequence[Scalar]) -> list[int]:
    """Where the entries are not the number zero."""
    return [i for i, entry in enumerate(row) if not is_zero(entry)]


def is_zero(entry: Scalar) -> bool:
    """Return whether an entry is the number zero, at every state."""
    return isinstance(entry, float) and entry == 0.0


def solve(factors: Factors, right: Sequence[Scalar]) -> list[Scalar]:
    """Solve L^T D L x = right for x, with the factors L and D of a symmetric matrix M = L^T D L."""
    load = list(right)
    solution = list(right)
    for k in reversed(range(len(load))):
        solution[k] = load[k] * factors.inverses[k]
        for i in _nonzero(factors.scaled[k]):
            load[i] = load[i] - factors.scaled[k][i] * solution[k]
    for k, row in enumerate(factors.lower):
        for i in _nonzero(row):
            solution[k] = solution[k] - row[i] * solution[i]
    return solution


def projected(factors: Factors, rows: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    """Compute the symmetric matrix J M^-1 J^T from the factors of M and the rows of J. With Y = J L^-1, the result is Y
    D^-1 Y^T. Both triangles are returned."""
    return half_products(factors, [half_solved(factors, row) for row in rows])


def half_products(factors: Factors, halves: Sequence[Sequence[Scalar]]) -> list[list[Scalar]]:
    """Compute the symmetric matrix Y D^-1 Y^T from the rows of Y (`halves`) and the factor D of a matrix L^T D L. Both
    triangles are returned."""
    found: list[list[Scalar]] = [[0.0] * len(halves) for _ in halves]
    for i, half in enumerate(halves):
        own = _nonzero(half)
        scaled = [half[k] * factors.inverses[k] for k in own]
        for j in range(i + 1):
            found[i][j] = found[j][i] = inner_product(scaled, [halves[j][k] for k in own])
    return found


def half_solved(factors: Factors, right: Sequence[Scalar]) -> list[Scalar]:
    """Solve L^T y = right for y, with the factors L^T D L of a matrix. An entry of y is zero if `right` is zero for the
    entry's joint and for all joints that this joint carries."""
    found = list(right)
    for k in reversed(range(len(found))):
        if not is_zero(found[k]):
            for i in _nonzero(factors.lower[k]):
                found[i] = found[i] - factors.lower[k][i] * found[k]
    return found


def rest_solved(factors: Factors, half: Sequence[Scalar]) -> list[Scalar]:
    """Solve D L x = half for x, with the factors M = L^T D L. If `half` is the result of `half_solved` for a vector
    `right`, then x solves M x = right."""
    solution = [value * inverse for value, inverse in zip(half, factors.inverses, strict=True)]
    for k, row in enumerate(factors.lower):
        for i in _nonzero(row):
            solution[k] = solution[k] - row[i] * solution[i]
    return solution


def inner_product(a: Sequence[Scalar], b: Sequence[Scalar]) -> Scalar:
    """Return the inner product a . b of vectors of equal length."""
    total: Scalar = 0.0
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


def product(a: Matrix, b: Matrix) -> list[list[Scalar]]:
    """Return a b."""
    columns = list(zip(*b, strict=True))
    return [[inner_product(row, column) for column in columns] for row in a]


def plus(a: Matrix, b: Matrix) -> list[list[Scalar]]:
    """Return a + b."""
    return [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def less(a: Matrix, b: Matrix) -> list[list[Scalar]]:
    """Return a - b."""
    return [[x - y for x, y in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]


def negative(a: Matrix) -> list[list[Scalar]]:
    """Return -a."""
    return [[-x for x in row] for row in a]


def inverse(factors: Factors) -> list[list[Scalar]]:
    """Compute M^-1 = L^-1 D^-1 L^-T from the factors of M = L^T D L. The lower triangle is computed, and both triangles
    are returned."""
    n = len(factors.pivots)
    columns = _inverse_of_lower(factors.lower)
    scaled = [[entry * factors.inverses[k] for k, entry in enumerate(row)] for row in columns]
    rows: list[list[Scalar]] = [[0.0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            total: Scalar = 0.0
            for k in range(j + 1):
                total = total + scaled[j][k] * columns[i][k]
            rows[i][j] = rows[j][i] = total
    return rows


def inverse_diagonal(factors: Factors) -> list[Scalar]:
    """The diagonal of M^-1."""
    found = []
    for row in _inverse_of_lower(factors.lower):
        total: Scalar = 0.0
        for entry, inverse in zip(row, factors.inverses, strict=False):
            total = total + entry * entry * inverse
        found.append(total)
    return found


def _inverse_of_lower(lower: Rows) -> list[list[Scalar]]:
    """Row i: the first i + 1 entries of the inverse's row i; ones on the diagonal."""
    found: list[list[Scalar]] = []
    for i, row in enumerate(lower):
        own: list[Scalar] = []
        for j in range(i):
            total = row[j]
            for k in range(j + 1, i):
                total = total + row[k] * found[k][j]
            own.append(-total)
        found.append([*own, 1.0])
    return found
