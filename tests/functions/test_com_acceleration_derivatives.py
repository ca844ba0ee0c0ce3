"""Derivatives of the centre of mass's acceleration against Pinocchio and against complex steps."""

from __future__ import annotations

import pytest
from against_pinocchio import EVERY, matches_pinocchio
from slopes_of import are_slopes
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("com_acceleration_derivatives", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("com_acceleration_derivatives", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ["small", "hand"])
def test_they_are_complex_steps(robot: str) -> None:
    are_slopes("com_acceleration_derivatives", "com_acceleration", robot)
