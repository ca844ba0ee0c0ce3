"""Drifts of frames against Pinocchio and against differences of their Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_drifts_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("jacobian_dot_qd", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_the_drift_is_the_jacobians_rate_times_qd(robot: str) -> None:
    own = bench(robot)
    q, qd, step = own.given["q"], own.given["qd"], 1e-6
    ahead, behind = (own.robot.frame_jacobian(q + s * step * qd) for s in (1, -1))
    expected = np.einsum("sfij,sj->sfi", (ahead - behind) / (2 * step), qd)
    found = own.robot.jacobian_dot_qd(q, qd)
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
