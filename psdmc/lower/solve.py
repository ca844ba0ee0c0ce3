"""Unrolled solution of M x = b for a symmetric positive definite M, from the last row up."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.dynamics.scalar import Scalar


class SingularMassMatrix(Exception):
    """A pivot is zero for every q; `joint` counts from the base, 0 first."""

    def __init__(self, joint: int) -> None:
        super().__init__(f"pivot {joint} is zero for every q")
        self.joint = joint


def solve_symmetric(
    matrix: Sequence[Sequence[Scalar]], right: Sequence[Scalar]
) -> tuple[list[Scalar], list[Scalar]]:
    """x and the n pivots, all positive where M is positive definite.

    M = L^T D L with L unit lower triangular: elimination starts at the tip, whose entries the composite-rigid-body sweep
    finishes first (Featherstone 2008, section 6.5). Raises SingularMassMatrix where a pivot is a constant not above 0.
    """
    n = len(right)
    rows = [list(row) for row in matrix]
    load = list(right)
    factors: list[list[Scalar]] = [[0.0] * n for _ in range(n)]
    pivots: list[Scalar] = [0.0] * n
    scaled: list[Scalar] = [0.0] * n
    for k in reversed(range(n)):
        pivots[k] = rows[k][k]
        if isinstance(pivots[k], float) and pivots[k] <= 0.0:
            raise SingularMassMatrix(k)
        inverse = 1.0 / pivots[k]
        scaled[k] = load[k] * inverse
        for i in range(k):
            factors[k][i] = rows[k][i] * inverse
        for i in range(k):
            for j in range(i + 1):
                rows[i][j] = rows[i][j] - factors[k][i] * rows[k][j]
            load[i] = load[i] - rows[k][i] * scaled[k]
    solution: list[Scalar] = []
    for k in range(n):
        value = scaled[k]
        for i in range(k):
            value = value - factors[k][i] * solution[i]
        solution.append(value)
    return solution, pivots
