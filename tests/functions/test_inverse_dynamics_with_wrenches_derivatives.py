"""Derivatives of torques under wrenches against Pinocchio and against complex steps."""

from __future__ import annotations

import pytest
from against_pinocchio import INTERPRETED, SEVERAL, matches_pinocchio, program_matches_pinocchio
from slopes_of import are_slopes
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("inverse_dynamics_with_wrenches_derivatives", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("inverse_dynamics_with_wrenches_derivatives", robot)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("inverse_dynamics_with_wrenches_derivatives", "small", 1e-11, in_c=False)


@pytest.mark.parametrize("robot", ["small", "hand"])
def test_they_are_complex_steps(robot: str) -> None:
    are_slopes("inverse_dynamics_with_wrenches_derivatives", "inverse_dynamics_with_wrenches", robot)
