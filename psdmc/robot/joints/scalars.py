"""Sine, cosine, square root and sign for floats, arrays and symbols (which record code). The functions of joint
coordinates, such as those of quaternions, consist of these operations.

A PROGRAM (list of operations) has no branches, so these functions do not test whether an angle is small. To avoid 0/0,
the functions add a number to numerator and denominator that is too small to change any other result.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from psdmc.reproducible import cosine, sine

Scalar = Any
"""A float, an array of states, or an object with arithmetic, `sincos()` and `root()`."""

TINY = 1e-36
"""Added to squares: sin(h) / h with h^2 = TINY is one. The square root of the smallest float32 is 1e-19."""

FAINT = 1e-18
"""Added to a number before its sign is taken, which is then never 0 / 0."""

FAINTER = 1e-54
"""Added to the square of such a sum. A sign is wrong by more than rounding only where it belongs to a number of 1e-18 less
1e-18, within 1e-26: none that a rotation of double precision comes to but by chance."""


def sincos(angle: Scalar) -> tuple[Scalar, Scalar]:
    """Return (sin, cos) of an angle in rad. The angle is a float, an array or a symbol (which records code)."""
    if hasattr(angle, "sincos"):
        s, c = angle.sincos()
        return s, c
    return sine(angle), cosine(angle)


def root(value: Scalar) -> Scalar:
    """Return the square root of a float, an array or a symbol (which records code)."""
    return value.root() if hasattr(value, "root") else np.sqrt(value)


def sign(value: Scalar) -> Scalar:
    """Return 1 for a positive value or zero, and -1 for a negative value. The code has no branch."""
    moved = value + FAINT
    return moved / root(moved * moved + FAINTER)


def square_of(values: Sequence[Scalar]) -> Scalar:
    """Return the sum of the squares of the values."""
    total = values[0] * values[0]
    for value in values[1:]:
        total = total + value * value
    return total


def unit(values: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Divide a vector by its length."""
    length = 1.0 / root(square_of(values))
    return tuple(value * length for value in values)
