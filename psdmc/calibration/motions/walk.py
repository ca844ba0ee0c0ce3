"""A better exciting motion by random steps from one that hits nothing, where a descent by slopes ends at an obstacle."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from psdmc.calibration.logs.log import Array

FIRST_STEP = 0.1
"""Of each coordinate of the space, whose random motions have standard deviations of one."""
SMALLEST_STEP = 1e-4
"""Below it a walk gains nothing that counts; it then begins again with the first."""
GROWTH = 1.25
"""Of the step after a success; after a failure its fourth root's inverse, so that a fifth of the steps succeed (Rechenberg
1973)."""


def walked(
    cost: Callable[[Array], float],
    point: Array,
    is_free: Callable[[Array], bool],
    steps: Iterable[object],
    rng: np.random.Generator,
) -> Array:
    """The cheapest point found in as many steps, one of those that are free; `point` is."""
    lowest, step = cost(point), FIRST_STEP
    for _ in steps:
        tried = point + step * rng.standard_normal(len(point))
        value = cost(tried)
        # whether it is free takes longer to find out, and is asked of what is better alone
        if value < lowest and is_free(tried):
            point, lowest, step = tried, value, step * GROWTH
        else:
            step = step * GROWTH**-0.25 if step > SMALLEST_STEP else FIRST_STEP
    return point
