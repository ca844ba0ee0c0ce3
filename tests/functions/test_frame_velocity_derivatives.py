"""Derivatives of frame velocities against Pinocchio and against differences of J qd."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("frame_velocity_derivatives", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_they_are_the_slopes_of_the_jacobian_times_qd(robot: str) -> None:
    own = bench(robot)
    q, qd, step = own.given["q"], own.given["qd"], 1e-6
    found = own.robot.frame_velocity_derivatives(q, qd)
    for j, unit in enumerate(np.eye(own.model.n)):
        ahead, behind = (own.robot.frame_jacobian(q + h * unit) @ qd[:, None, :, None] for h in (step, -step))
        slope = (ahead - behind)[..., 0] / (2 * step)
        np.testing.assert_allclose(found[..., j], slope, atol=1e-7 * np.abs(found).max())


@pytest.mark.parametrize("robot", ARMS)
def test_along_the_motion_they_are_the_drift(robot: str) -> None:
    own = bench(robot)
    q, qd = own.given["q"], own.given["qd"]
    found = (own.robot.frame_velocity_derivatives(q, qd) @ qd[:, None, :, None])[..., 0]
    drift = own.robot.jacobian_dot_qd(q, qd)
    np.testing.assert_allclose(found, drift, atol=1e-13 * np.abs(drift).max())
