"""Arithmetic that gives the same digits on every processor and with any number of threads.

BLAS, LAPACK and einsum order their sums, and fuse products with sums, differently on different processors. Vectorised
sines and exponentials differ, too.

So psdmc computes all numbers in models and packages with the functions of this module. These functions use only NumPy's
elementwise operations, which IEEE 754 defines to the last bit. The order of operations depends on shapes and zeros
alone. Results have the precision of the arguments.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


BLOCK = 1 << 18
"""Bytes of a stack's products that are computed at once: a share of a core's own cache."""


_any_order: ContextVar[bool] = ContextVar("any order", default=False)


@contextmanager
def in_any_order() -> Iterator[None]:
    """Within the block, use the products of BLAS, the solver of LAPACK and the sines of NumPy, which are several times
    faster than this module's. The last digits of results then depend on the processor. Use the block only for values
    that are not written to a file."""
    before = _any_order.set(True)
    try:
        yield
    finally:
        _any_order.reset(before)


def times(a: Array, b: Array) -> Any:
    """Return the matrix product a @ b of matrices and vectors, or of stacks of matrices (..., m, n) and (..., n, k).
    The terms of each entry are added in order."""
    if _any_order.get():
        return a @ b
    if b.ndim > 2:
        return _stacked(a, b)
    if a.ndim == b.ndim == 1:
        return np.add.accumulate(a * b)[
            -1
        ]  # in the order of the entries; np.sum's order depends on their number
    wide = b.ndim == 2
    total = a[..., 0, None] * b[0] if wide else a[..., 0] * b[0]
    for k in range(1, b.shape[0]):
        total += a[..., k, None] * b[k] if wide else a[..., k] * b[k]
    return total


def _stacked(a: Array, b: Array) -> Array:
    lead, rows, columns = np.broadcast_shapes(a.shape[:-2], b.shape[:-2]), a.shape[-2], b.shape[-1]
    left = np.broadcast_to(a, (*lead, *a.shape[-2:])).reshape(-1, rows, a.shape[-1])
    right = np.broadcast_to(b, (*lead, *b.shape[-2:])).reshape(-1, b.shape[-2], columns)
    total = np.zeros((len(left), rows, columns), np.result_type(a, b))
    size = max(1, BLOCK // max(1, rows * columns * total.itemsize))
    # What is zero throughout, as in an identity, adds nothing.
    used_rows = [np.flatnonzero(column) for column in np.any(left != 0.0, axis=0).T]
    used_columns = [np.flatnonzero(row) for row in np.any(right != 0.0, axis=0)]
    for start in range(0, len(total), size):
        x, y, found = (part[start : start + size] for part in (left, right, total))
        term = np.empty_like(found)
        for k, (down, across) in enumerate(zip(used_rows, used_columns, strict=True)):
            if 2 * len(across) <= columns:
                found[:, :, across] += x[:, :, k, None] * y[:, k][:, None, across]
            elif 2 * len(down) <= rows:
                found[:, down] += x[:, down, k, None] * y[:, None, k]
            else:
                found += np.multiply(x[:, :, k, None], y[:, None, k], out=term)
    return total.reshape(*lead, rows, columns)


def combined(weights: Array, rows: Array) -> Array:
    """Return the weighted sum (k,) of the m rows of an array (m, k), with one weight per row, (m,). The rows are added
    in order."""
    return np.asarray(np.add.reduce(weights[:, None] * rows, axis=0))


def lengths(rows: Array) -> Array:
    """Return the Euclidean lengths (k,) of the columns of an array (m, k)."""
    return np.asarray(np.sqrt(np.add.reduce(rows * rows, axis=0)))


def length(v: Array) -> float:
    """Return the Euclidean norm of a vector."""
    return math.sqrt(times(v, v))


def cross(a: Array, b: Array) -> Array:
    """Return the cross product a x b of two vectors. It is ten times faster than NumPy's, which accepts more shapes."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def solved(matrices: Array, right: Array) -> Array:
    """Return the solutions x (..., n, k) of linear systems `matrices` @ x = `right`, by elimination with partial
    pivoting. The n x n systems have k right sides (..., n, k).

    A singular matrix gives numbers that are not finite.
    """
    n = matrices.shape[-1]
    shape = np.broadcast_shapes(matrices.shape[:-2], right.shape[:-2])
    wide = [np.broadcast_to(part, (*shape, *part.shape[-2:])) for part in (matrices, right)]
    if _any_order.get():
        # The elimination accepts a matrix that is exactly singular.
        with suppress(np.linalg.LinAlgError):
            return np.asarray(np.linalg.solve(*wide))
    work = np.concatenate(wide, axis=-1).reshape(-1, n, n + right.shape[-1])
    each = np.arange(len(work))
    with np.errstate(divide="ignore", invalid="ignore"):
        for j in range(n):
            best = j + np.argmax(np.abs(work[:, j:, j]), axis=1)
            work[each, best], work[:, j] = work[:, j].copy(), work[each, best]
            shares = work[:, j + 1 :, j] / work[:, j, j, None]
            work[:, j + 1 :, j:] -= shares[..., None] * work[:, j, None, j:]
        for j in reversed(range(n)):
            work[:, j, n:] /= work[:, j, j, None]
            work[:, :j, n:] -= work[:, :j, j, None] * work[:, j, None, n:]
    return work[:, :, n:].reshape(*shape, n, right.shape[-1])


def inverse(matrices: Array) -> Array:
    """Return the inverses of n x n matrices (..., n, n). A singular matrix gives numbers that are not finite."""
    unit = np.eye(matrices.shape[-1], dtype=matrices.dtype)
    return solved(matrices, np.broadcast_to(unit, matrices.shape))


def triangle_solved(triangle: Array, right: Array) -> Array:
    """Return the solution x (l, k) of `triangle` @ x = `right`, for an upper triangular matrix (l, l) and k right sides
    (l, k).

    The entries of `triangle` below the diagonal are not read, because they hold rounding errors only. In a row whose
    entries are as small as 1e-13, these errors would change the solution.
    """
    solution = right.copy()
    for r in reversed(range(len(triangle))):
        solution[r] /= triangle[r, r]
        above = np.flatnonzero(triangle[:r, r])
        solution[above] -= triangle[above, r, None] * solution[r]
    return solution


def sine(angle: Any) -> Any:
    """Return sin of a float or an array in rad, in the precision of the argument.

    The value is computed with the C library's long double and rounded to double, so the value is the same on all
    processors.
    """
    return _rounded(np.sin, angle)


def cosine(angle: Any) -> Any:
    """Return the cosine of a float or an array in rad, with equal digits on all processors (see `sine`)."""
    return _rounded(np.cos, angle)


def arcsine(value: Any) -> Any:
    """Return the arcsine of a float or an array, in rad, with equal digits on all processors (see `sine`)."""
    return _rounded(np.arcsin, value)


def angle_of(y: Any, x: Any) -> Any:
    """Return the angle atan2(y, x) of floats or arrays, in rad, with equal digits on all processors (see `sine`)."""
    return _rounded(np.arctan2, y, x)


def exponential(value: Any) -> Any:
    """Return the exponential of a float or an array, with equal digits on all processors (see `sine`)."""
    return _rounded(np.exp, value)


def hyperbolic_tangent(value: Any) -> Any:
    """Return the hyperbolic tangent of a float or an array, with equal digits on all processors (see `sine`)."""
    return _rounded(np.tanh, value)


def logarithm(value: Any) -> Any:
    """Return the natural logarithm of a float or an array, with equal digits on all processors (see `sine`)."""
    return _rounded(np.log, value)


def power(base: Any, exponent: Any) -> Any:
    """Return base^exponent of floats or arrays, with equal digits on all processors (see `sine`)."""
    return _rounded(np.power, base, exponent)


def _rounded(function: Any, *values: Any) -> Any:
    if _any_order.get():
        return function(*values)
    if all(isinstance(value, float) for value in values):
        return float(function(*map(np.longdouble, values)))
    given = [np.asarray(value) for value in values]
    found = function(*(each.astype(np.longdouble) for each in given))
    if any(each.dtype == np.longdouble for each in given):
        return found
    return found.astype(np.float64) if found.ndim else float(found)
