"""Derivatives of accelerations under wrenches against Pinocchio and against complex steps."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio
from slopes_of import are_slopes
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_dynamics_with_wrenches_derivatives", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("forward_dynamics_with_wrenches_derivatives", robot)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("forward_dynamics_with_wrenches_derivatives", "small", 1e-9)


@pytest.mark.parametrize("robot", ["small", "hand"])
def test_they_are_complex_steps(robot: str) -> None:
    are_slopes("forward_dynamics_with_wrenches_derivatives", "forward_dynamics_with_wrenches", robot, 1e-9)


def test_without_wrenches_they_are_those_of_forward_dynamics() -> None:
    own = bench(ARM)
    g = own.given
    states = (g["q"], g["qd"], g["tau"])
    found = own.robot.forward_dynamics_with_wrenches_derivatives(*states, np.zeros_like(g["wrenches"]))
    for one, other in zip(own.robot.forward_dynamics_derivatives(*states), found[:4], strict=True):
        np.testing.assert_allclose(other, one, atol=1e-11 * np.abs(one).max())
