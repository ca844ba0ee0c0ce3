"""Sine, cosine and square root of abstract scalars, of which the group operations of joints are made, and tiny numbers
that keep their quotients defined.

PROGRAMs have no branches. So nothing here asks whether an angle is small: 0/0 is avoided by adding to both sides what is
lost beside any other value.
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
    """(sin, cos) of an angle in rad; symbols have a method for it."""
    if hasattr(angle, "sincos"):
        s, c = angle.sincos()
        return s, c
    return sine(angle), cosine(angle)


def root(value: Scalar) -> Scalar:
    """The square root; symbols have a method for it."""
    return value.root() if hasattr(value, "root") else np.sqrt(value)


def sign(value: Scalar) -> Scalar:
    """1 or -1; of zero 1."""
    moved = value + FAINT
    return moved / root(moved * moved + FAINTER)


def square_of(values: Sequence[Scalar]) -> Scalar:
    """The sum of their squares."""
    total = values[0] * values[0]
    for value in values[1:]:
        total = total + value * value
    return total


def unit(values: Sequence[Scalar]) -> tuple[Scalar, ...]:
    """Divide a vector by its length."""
    length = 1.0 / root(square_of(values))
    return tuple(value * length for value in values)
