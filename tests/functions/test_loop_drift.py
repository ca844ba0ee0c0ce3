"""Drifts of closed loops against Pinocchio's accelerations, and against differences of the Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from loop_trees import loop_tree
from test_loop_error import TREES


@pytest.mark.parametrize(("seed", "floating"), TREES)
def test_drifts_are_pinocchios(seed: int, floating: bool) -> None:
    own = loop_tree(seed, floating)
    (expected,) = own.expected("loop_drift").values()
    for (found,) in own.found("loop_drift"):
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(("seed", "floating"), TREES)
def test_the_drift_is_the_jacobians_rate_times_qd(seed: int, floating: bool) -> None:
    own, step = loop_tree(seed, floating), 1e-6
    model, q, qd = own.model, own.given["q"], own.given["qd"]
    ahead, behind = (model.loop_jacobian(model.integrate(q, sign * step * qd)) for sign in (1, -1))
    expected = np.einsum("sij,sj->si", (ahead - behind) / (2 * step), qd)
    np.testing.assert_allclose(model.loop_drift(q, qd), expected, atol=1e-7 * np.abs(expected).max())
