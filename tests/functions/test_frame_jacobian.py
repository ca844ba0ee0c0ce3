"""Jacobians of frames against Pinocchio and against differences of forward kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_jacobians_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("frame_jacobian", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_columns_are_rates_of_forward_kinematics(robot: str) -> None:
    """Position's derivative, and the angular velocity w with dR/dq R^T = [w], by central differences."""
    own = bench(robot)
    q, step = own.given["q"], 1e-6
    found = own.robot.frame_jacobian(q)[:, 0]
    for j in range(own.model.n):
        ahead, behind = (own.robot.forward_kinematics(q + s * step * np.eye(own.model.n)[j]) for s in (1, -1))
        linear = (ahead.position - behind.position)[:, 0] / (2 * step)
        spin = (ahead.rotation - behind.rotation)[:, 0] / (2 * step)
        here = own.robot.forward_kinematics(q).rotation[:, 0]
        cross = spin @ here.transpose(0, 2, 1)
        angular = np.stack([cross[:, 2, 1], cross[:, 0, 2], cross[:, 1, 0]], axis=1)
        np.testing.assert_allclose(found[:, :3, j], linear, atol=1e-8)
        np.testing.assert_allclose(found[:, 3:, j], angular, atol=1e-8)
