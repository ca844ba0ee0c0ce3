"""Products of small matrices, the same on every processor and in whatever precision the arrays have: BLAS fuses and
orders its sums as each machine likes it."""

from __future__ import annotations

import math
from typing import Any

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
