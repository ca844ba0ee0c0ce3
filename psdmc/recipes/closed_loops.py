"""The common parts of the functions of closed loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

ROW_WORDS = (
    "along and about the axes of the loop's first frame. There is one {} for each direction that a loop blocks. "
    "The order is loop by loop, first linear directions (x, y, z), then angular ones (rx, ry, rz)"
)


def of_loops(robot: Reference, values: Callable[[int, int, tuple[int, ...]], Array]) -> Array:
    """Join the values of all loops, each computed from Pinocchio's numbers of its two frames and from its rows."""
    return np.concatenate([values(*loop) for loop in robot.loops])
