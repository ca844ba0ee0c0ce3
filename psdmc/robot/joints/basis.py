"""The functions 1, sin q, cos q, q ... of a joint's coordinate q, of which torques consist. The derivation finds the
torques as polynomials in these functions of all joints, by interpolation."""

from __future__ import annotations

import math
from dataclasses import dataclass

Exponents = tuple[int, int, int]
"""Of q, sin q and cos q."""


@dataclass(frozen=True, slots=True)
class Basis:
    """The functions of one joint coordinate q that occur in torques, such as 1, sin q, cos q. The number of a function
    is called a digit; digit 0 is the constant 1.

    exponents    for each digit, the exponents of q, sin q and cos q. The first `linear` functions have degree one at
                 most, all others degree two. A product of two of the first is a sum of functions of the basis
    derivatives  for each digit, the derivative of the function by q: a sum, as pairs of a digit and a factor
    nodes        values of q, one per digit, at which torques are sampled. They make the interpolation well conditioned
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
        """Number of functions in the basis."""
        return len(self.exponents)

    @property
    def has_sincos(self) -> bool:
        """Return whether the sine or cosine of the coordinate occurs in the basis."""
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
