"""Random states of a robot, for comparisons of torques."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RANGES = (np.pi, 3.0, 5.0)
"""q (rad or m), qd and qdd are drawn from plus or minus these."""


def random_states(rng: np.random.Generator, *shape: int) -> tuple[Array, Array, Array]:
    """q, qd and qdd, arrays of this shape each."""
    q, qd, qdd = (limit * rng.uniform(-1.0, 1.0, shape) for limit in RANGES)
    return q, qd, qdd
