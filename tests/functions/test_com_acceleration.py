"""The acceleration of the centre of mass against Pinocchio and along the motion."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("com_acceleration", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("com_acceleration", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ARMS)
def test_it_is_how_the_velocity_changes_along_the_motion(robot: str) -> None:
    own = bench(robot)
    q, qd, qdd = (own.given[name] for name in ("q", "qd", "qdd"))
    by_q, by_qd = own.robot.com_velocity_derivatives(q, qd)
    expected = np.einsum("kij,kj->ki", by_q, qd) + np.einsum("kij,kj->ki", by_qd, qdd)
    found = own.robot.com_acceleration(q, qd, qdd)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
