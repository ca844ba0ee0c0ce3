"""Arithmetic that gives the same digits on every processor and with any number of threads.

BLAS, LAPACK and einsum choose the order of their sums, and whether products and sums are fused, by the processor. Vectorised
elementary functions choose their approximations by it. What is written into a model or a package is computed by the
functions of this module instead: each is made of NumPy's elementwise operations, which IEEE 754 defines to the last bit, in
an order that shapes and zeros alone decide. Arrays keep their precision.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
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
    """Products and sines inside the block are BLAS's and NumPy's: several times as fast, for values that nothing writes."""
    before = _any_order.set(True)
    try:
        yield
    finally:
        _any_order.reset(before)


def times(a: Array, b: Array) -> Any:
    """a @ b for matrices, vectors and stacks of matrices (..., m, n) and (..., n, k), terms added one after the other."""
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
    """(k,) sum of (m, k) rows times their weights (m,), one after the other; for many rows."""
    return np.asarray(np.add.reduce(weights[:, None] * rows, axis=0))


def lengths(rows: Array) -> Array:
    """(k,) Euclidean lengths of the columns of (m, k) rows."""
    return np.asarray(np.sqrt(np.add.reduce(rows * rows, axis=0)))


def length(v: Array) -> float:
    """Euclidean norm of a vector."""
    return math.sqrt(times(v, v))


def cross(a: Array, b: Array) -> Array:
    """a x b of two vectors: NumPy's takes ten times as long, for it asks which way arrays lie."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def solved(matrices: Array, right: Array) -> Array:
    """(..., n, k) solutions x of matrices (..., n, n) @ x = right (..., n, k), by elimination with partial pivoting.

    A singular matrix gives numbers that are not finite.
    """
    n = matrices.shape[-1]
    shape = np.broadcast_shapes(matrices.shape[:-2], right.shape[:-2])
    wide = [np.broadcast_to(part, (*shape, *part.shape[-2:])) for part in (matrices, right)]
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
    """(..., n, n) inverses of matrices; numbers that are not finite where one is singular."""
    unit = np.eye(matrices.shape[-1], dtype=matrices.dtype)
    return solved(matrices, np.broadcast_to(unit, matrices.shape))


def triangle_solved(triangle: Array, right: Array) -> Array:
    """(l, k) solution x of triangle (l, l) @ x = right (l, k). What is below the diagonal of `triangle` is not read: it is
    rounding, which is nothing in a row of length one and much in a row of 1e-13."""
    solution = right.copy()
    for r in reversed(range(len(triangle))):
        solution[r] /= triangle[r, r]
        above = np.flatnonzero(triangle[:r, r])
        solution[above] -= triangle[above, r, None] * solution[r]
    return solution


def sine(angle: Any) -> Any:
    """sin of a float or an array in rad, in its precision.

    Doubles are rounded from the C library's long double, which no instruction set decides.
    """
    return _rounded(np.sin, angle)


def cosine(angle: Any) -> Any:
    """cos of a float or an array in rad, as `sine`."""
    return _rounded(np.cos, angle)


def arcsine(value: Any) -> Any:
    """asin of a float or an array in rad, as `sine`."""
    return _rounded(np.arcsin, value)


def angle_of(y: Any, x: Any) -> Any:
    """atan2 of floats or arrays in rad, as `sine`."""
    return _rounded(np.arctan2, y, x)


def exponential(value: Any) -> Any:
    """exp of a float or an array, as `sine`."""
    return _rounded(np.exp, value)


def hyperbolic_tangent(value: Any) -> Any:
    """tanh of a float or an array, as `sine`."""
    return _rounded(np.tanh, value)


def logarithm(value: Any) -> Any:
    """Natural logarithm of a float or an array, as `sine`."""
    return _rounded(np.log, value)


def power(base: Any, exponent: Any) -> Any:
    """base^exponent of floats or arrays, as `sine`."""
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
