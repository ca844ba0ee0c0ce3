"""A descent by score: candidates are tried in order, and a strictly lower score is moved to, until the budget is spent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from psdmc.lower.factored import Arrangement

ROUNDING = 1e-6
"""Differences of scores below this are rounding: weights have few decimals."""


class Descent:
    """The cheapest arrangement so far, and the rest of the budget."""

    arrangement: Arrangement

    def __init__(
        self,
        score: Callable[[Arrangement], float],
        budget: int,
        is_admitted: Callable[[Arrangement], bool],
    ) -> None:
        self._score_of, self._left, self._score = score, budget, math.inf
        self._is_admitted = is_admitted

    def consider(
        self, candidates: Iterator[Arrangement], expected: Callable[[Arrangement], float] | None = None
    ) -> bool:
        """Try candidates in order, moving to each that is cheaper. Returns whether any was.

        expected  a score that costs less to find: candidates that are no cheaper by it are not tried
        """
        improved = False
        for candidate in candidates:
            if self._left == 0:
                return False
            self._left -= 1
            if expected is not None and expected(candidate) > self._score + ROUNDING:
                continue
            score = self._score_of(candidate)
            if score < self._score and self._is_admitted(candidate):
                self.arrangement, self._score, improved = candidate, score, True
        return improved
