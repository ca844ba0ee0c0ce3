"""Products of small matrices, the same on every processor and in whatever precision the arrays have. (BLAS fuses and
orders its sums differently from machine to machine.)"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def times(a: Array, b: Array) -> Any:
    """a @ b for matrices and vectors, the terms added one after the other."""
    wide = b.ndim == 2
    total = a[..., 0, None] * b[0] if wide else a[..., 0] * b[0]
    for k in range(1, b.shape[0]):
        total += a[..., k, None] * b[k] if wide else a[..., k] * b[k]
    return total


def length(v: Array) -> float:
    """Euclidean norm of a vector."""
    return math.sqrt(times(v, v))


def cross(a: Array, b: Array) -> Array:
    """a x b of two vectors: NumPy's takes ten times as long, for it asks which way arrays lie."""
    (a0, a1, a2), (b0, b1, b2) = a, b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])
