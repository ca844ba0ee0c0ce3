"""Jacobians of closed loops against Pinocchio's of their frames, and against differences of the loops' errors."""

from __future__ import annotations

import numpy as np
import pytest
from loop_trees import loop_tree
from test_loop_error import TREES


@pytest.mark.parametrize(("seed", "floating"), TREES)
def test_jacobians_are_pinocchios(seed: int, floating: bool) -> None:
    own = loop_tree(seed, floating)
    (expected,) = own.expected("loop_jacobian").values()
    for (found,) in own.found("loop_jacobian"):
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("seed", "floating"), TREES)
def test_a_jacobian_is_the_derivative_of_the_error_where_the_loop_is_closed(
    seed: int, floating: bool
) -> None:
    own, step = loop_tree(seed, floating), 1e-6
    model, q, nv = own.model, own.closed, own.model.nv
    ways = step * np.eye(nv)
    ahead, behind = (model.loop_error(model.integrate(q, sign * ways)) for sign in (1, -1))
    np.testing.assert_allclose(((ahead - behind) / (2 * step)).T, model.loop_jacobian(q), atol=1e-8)
    # Linear rows are derivatives everywhere.
    linear = [k for k, row in enumerate(r for loop in model.mechanism.loops for r in loop.rows) if row < 3]
    q = own.given["q"][0]
    ahead, behind = (model.loop_error(model.integrate(q, sign * ways)) for sign in (1, -1))
    found = ((ahead - behind) / (2 * step)).T[linear]
    np.testing.assert_allclose(found, model.loop_jacobian(q)[linear], atol=1e-8)
