"""The factors 1, sin q, cos q, q ... that a joint's motion is made of; derivation interpolates in their products."""

from __future__ import annotations

import math
from dataclasses import dataclass

Exponents = tuple[int, int, int]
"""Of q, sin q and cos q."""


@dataclass(frozen=True, slots=True)
class Basis:
    """Factors that depend on one coordinate, numbered by digit; digit 0 is the constant one.

    exponents    by digit; the first `linear` are of degree one at most, all of degree two at most: products of two of
                 degree one are sums of these
    derivatives  by digit: the digits and factors that d/dq of it is the sum of
    nodes        as many as there are digits: where products are sampled, so that the matrix of values is well conditioned
    """

    exponents: tuple[Exponents, ...]
    linear: int
    derivatives: tuple[tuple[tuple[int, float], ...], ...]
    nodes: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.linear <= len(self.exponents) == len(self.derivatives) == len(self.nodes):
            raise ValueError("exponents, derivatives and nodes of a basis are not equally many")

    @property
    def size(self) -> int:
        """Number of digits."""
        return len(self.exponents)

    @property
    def has_sincos(self) -> bool:
        """Whether sine or cosine of the coordinate occurs."""
        return any(sine or cosine for _, sine, cosine in self.exponents)


TRIGONOMETRIC = Basis(
    exponents=((0, 0, 0), (0, 1, 0), (0, 0, 1), (0, 1, 1), (0, 0, 2)),
    linear=3,
    derivatives=((), ((2, 1.0),), ((1, -1.0),), ((4, 2.0), (0, -1.0)), ((3, -2.0),)),
    nodes=tuple(2.0 * math.pi * k / 5.0 for k in range(5)),
)
"""1, s, c, s c, c^2 (s^2 = 1 - c^2); nodes equally spaced on the circle."""

POLYNOMIAL = Basis(
    exponents=((0, 0, 0), (1, 0, 0), (2, 0, 0)),
    linear=2,
    derivatives=((), ((0, 1.0),), ((1, 2.0),)),
    nodes=(-1.0, 0.0, 1.0),
)
"""1, q, q^2."""

NO_BASIS = Basis(exponents=((0, 0, 0),), linear=1, derivatives=((),), nodes=(0.0,))
"""Of a joint with several coordinates, whose torques are not expanded."""
