"""What the algorithms ask of a number, and three-vectors of such numbers.

A scalar is anything with + - * / and unary minus that mixes with floats: a float, a NumPy array of states, or a symbol
that records what is done to it. Exact zeros and ones of the robot stay Python floats, so that a recording scalar can
drop them; on arrays they cost a little and change nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Scalar = Any
"""A float, an array of states, or an object with arithmetic and `sincos()`."""

Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)


def sincos(angle: Scalar) -> tuple[Scalar, Scalar]:
    """(sin, cos) of an angle in rad; symbols bring their own."""
    if hasattr(angle, "sincos"):
        sine, cosine = angle.sincos()
        return sine, cosine
    return np.sin(angle), np.cos(angle)


def add(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def scale(a: Vector, factor: Scalar) -> Vector:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vector, b: Vector) -> Scalar:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def transform(rows: Matrix, v: Vector) -> Vector:
    """rows @ v"""
    return (dot(rows[0], v), dot(rows[1], v), dot(rows[2], v))


def transpose(rows: Matrix) -> Matrix:
    return (
        (rows[0][0], rows[1][0], rows[2][0]),
        (rows[0][1], rows[1][1], rows[2][1]),
        (rows[0][2], rows[1][2], rows[2][2]),
    )


def multiply(a: Matrix, b: Matrix) -> Matrix:
    columns = transpose(b)
    product = tuple(tuple(dot(row, column) for column in columns) for row in a)
    return product  # type: ignore[return-value]
