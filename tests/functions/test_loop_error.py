"""Errors of closed loops against Pinocchio's placements."""

from __future__ import annotations

import numpy as np
import pytest
from loop_trees import loop_tree
from slow_cases import slow_but_for

TREES = slow_but_for(
    [(0, True), (1, False)], [(seed, bool(k)) for seed in range(4) for k in (0, 1)], spread=True
)


@pytest.mark.parametrize(("seed", "floating"), TREES)
def test_errors_are_pinocchios(seed: int, floating: bool) -> None:
    own = loop_tree(seed, floating)
    (expected,) = own.expected("loop_error").values()
    for (found,) in own.found("loop_error"):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert np.abs(expected[:-1]).min() > 1e-3
    assert np.abs(expected[-1]).max() < 1e-12
