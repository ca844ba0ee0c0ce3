"""Before anything is timed, compare the outputs of all libraries with psdmc's Newton-Euler recursion in NumPy."""

from __future__ import annotations

import numpy as np

from psdmc.bench.contestant import Runner
from psdmc.bench.states import States, output_sizes
from psdmc.functions import RECIPES
from psdmc.recipes.recipe import Needs
from psdmc.robot.mechanism import Array

CHECKED = 1024
"""States compared; enough to meet every term of a robot's dynamics."""

CHECKED_REALS = 1 << 24
"""Outputs compared, 128 MiB of them: a humanoid's regressor in standard parameters has 12,000 a state."""

FEWEST = 64
"""States compared of the largest of robots."""

SOLVED = 1e-7
STRICT = 1e-10
"""Largest error of an output relative to its largest value; forward dynamics amplifies rounding by the mass matrix's
condition number."""

SMALL = 1e-3
"""Outputs that stay below this share of the largest one are compared on its scale: they may be zero."""


def checked_states(outputs: int) -> int:
    """Return how many states of a function with this number of output values are compared. The number is a power of
    two, so that the states fill whole batches."""
    return min(CHECKED, 1 << int(np.log2(max(FEWEST, CHECKED_REALS // outputs))))


def disagreement(runner: Runner, states: States) -> float:
    """Return the largest error of a library's results for one function. The error of each output array is divided by
    the largest value of this array."""
    expected = states.expected(runner.contestant.function)
    found = runner.outputs()
    if runner.contestant.convention == "MuJoCo":
        found = states.from_mujoco(found)
    weights = runner.contestant.weights
    if weights is not None:
        found = found.reshape(states.count, -1, len(weights)) @ weights
        return relative_error(found, expected)
    ends = np.cumsum(output_sizes(runner.contestant.function, states.sizes))[:-1]
    blocks = zip(np.split(found, ends, axis=1), np.split(expected, ends, axis=1), strict=True)
    return max(relative_error(*block) for block in blocks)


def relative_error(found: Array, expected: Array) -> float:
    """Return the largest relative error of outputs: infinite if a value is NaN, absolute if all expected values are
    zero."""
    largest = np.max(np.abs(expected), axis=0)
    error = np.abs(found - expected) / np.maximum(largest, SMALL * np.max(largest) or 1.0)
    return float(np.max(error)) if np.isfinite(error).all() else float("inf")


def tolerance(function: str) -> float:
    """Largest relative error with which the outputs of a function still count as equal to the expected ones."""
    return SOLVED if RECIPES[function].needs is Needs.POSITIVE_MASS else STRICT
