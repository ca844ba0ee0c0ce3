"""Frame accelerations against Pinocchio and against Jacobian and drift."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("frame_acceleration", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("frame_acceleration", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ARMS)
def test_it_is_the_jacobian_times_qdd_and_the_drift(robot: str) -> None:
    own = bench(robot)
    q, qd, qdd = (own.given[name] for name in ("q", "qd", "qdd"))
    expected = own.robot.frame_jacobian(q) @ qdd[:, None, :, None]
    expected = expected[..., 0] + own.robot.jacobian_dot_qd(q, qd)
    found = own.robot.frame_acceleration(q, qd, qdd)
    np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())
