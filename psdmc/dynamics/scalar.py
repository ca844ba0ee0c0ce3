"""The scalars that the algorithms compute with, and three-vectors of scalars.

A scalar is anything with + - * / and unary minus that mixes with floats. Examples are a float, a NumPy array with one
value per state, and a symbol that records each operation. Zeros and ones of the robot's geometry stay Python floats.
Symbols leave out additions of zero and multiplications by zero or one.
"""

from __future__ import annotations

from typing import Any

from psdmc.robot.joints.scalars import sincos as sincos

Scalar = Any
"""A float, an array of states, or an object with arithmetic and `sincos()`."""

Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]

ZERO: Vector = (0.0, 0.0, 0.0)

Terms = tuple[tuple[int, float], ...]
"""A row of constants without its zeros: each with its place."""

Fixed = tuple[Terms, Terms, Terms]
"""A constant 3 x 3 matrix row by row: in most of a robot's rotations all but three entries are zero."""


def add(a: Vector, b: Vector) -> Vector:
    """a + b"""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def scale(a: Vector, factor: Scalar) -> Vector:
    """k v"""
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def dot(a: Vector, b: Vector) -> Scalar:
    """a . b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """a x b"""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def transform(rows: Matrix, v: Vector) -> Vector:
    """rows @ v"""
    return (dot(rows[0], v), dot(rows[1], v), dot(rows[2], v))


def transpose(rows: Matrix) -> Matrix:
    """The transposed matrix."""
    return (
        (rows[0][0], rows[1][0], rows[2][0]),
        (rows[0][1], rows[1][1], rows[2][1]),
        (rows[0][2], rows[1][2], rows[2][2]),
    )


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """a @ b"""
    columns = transpose(b)
    product = tuple(tuple(dot(row, column) for column in columns) for row in a)
    return product  # type: ignore[return-value]


def fixed(rows: Matrix) -> Fixed:
    """Return the entries of a 3 x 3 matrix of floats that are not zero: one tuple of (column, value) pairs per row."""
    first, second, third = (tuple((k, x) for k, x in enumerate(row) if x != 0.0) for row in rows)
    return first, second, third


def rotated(rows: Fixed, v: Vector) -> Vector:
    """rows @ v"""
    return (_total(rows[0], v), _total(rows[1], v), _total(rows[2], v))


def rotated_tensor(rows: Fixed, tensor: Matrix) -> Matrix:
    """rows @ tensor @ rows^T"""
    columns = transpose(tensor)
    once: list[Vector] = [
        (_total(row, columns[0]), _total(row, columns[1]), _total(row, columns[2])) for row in rows
    ]
    return (rotated(rows, once[0]), rotated(rows, once[1]), rotated(rows, once[2]))


def _total(terms: Terms, values: Vector) -> Scalar:
    """The sum of constants times values, in the order of their places."""
    total: Scalar = None
    for k, factor in terms:
        part = values[k] if factor == 1.0 else values[k] * factor
        total = part if total is None else total + part
    return 0.0 if total is None else total
