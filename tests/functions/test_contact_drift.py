"""Drifts of contacts against Pinocchio, and against differences of their Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_drifts_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("contact_drift", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_the_drift_is_the_jacobians_rate_times_qd(robot: str) -> None:
    own = bench(robot)
    q, qd, step = own.given["q"], own.given["qd"], 1e-6
    ahead, behind = (own.robot.contact_jacobian(q + s * step * qd) for s in (1, -1))
    expected = np.einsum("sij,sj->si", (ahead - behind) / (2 * step), qd)
    found = own.robot.contact_drift(q, qd)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
