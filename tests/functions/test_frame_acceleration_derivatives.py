"""Derivatives of frame accelerations against Pinocchio and against complex steps."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, EVERY, bench, matches_pinocchio
from slopes_of import are_slopes
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("frame_acceleration_derivatives", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("frame_acceleration_derivatives", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ["small", "hand"])
def test_they_are_complex_steps(robot: str) -> None:
    are_slopes("frame_acceleration_derivatives", "frame_acceleration", robot)


def test_at_rest_those_by_q_are_the_velocitys() -> None:
    own = bench(ARM)
    q, qd = own.given["q"], own.given["qd"]
    found = own.robot.frame_acceleration_derivatives(q, np.zeros_like(qd), qd).da_dq
    expected = own.robot.frame_velocity_derivatives(q, qd)
    np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())
