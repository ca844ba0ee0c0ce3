"""A search for the cheapest arrangement (frames, parameters and recursion of generated code). It tries candidates in
order and takes each one with a strictly lower score, until its budget of candidates is spent."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from psdmc.lower.factored import Arrangement

ROUNDING = 1e-6
"""Differences of scores below this are rounding: weights have few decimals."""


class Descent:
    """The state of a search: the cheapest form of the code so far, and how many candidates may still be tried. The form
    is a choice of link frames, nonzero link parameters and options of the recursion (an arrangement)."""

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
        """Try candidates in order, and take each one with a lower score. Return whether any candidate was taken.

        expected  a rough estimate of the score that takes less time; candidates whose estimate is not lower are not
                  tried
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
