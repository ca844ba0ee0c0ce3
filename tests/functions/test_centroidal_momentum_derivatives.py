"""Derivatives of the centroidal momentum against Pinocchio and against complex steps."""

from __future__ import annotations

import pytest
from against_pinocchio import EVERY, matches_pinocchio
from slopes_of import are_slopes
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("centroidal_momentum_derivatives", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("centroidal_momentum_derivatives", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ["small", "hand"])
def test_they_are_complex_steps(robot: str) -> None:
    are_slopes("centroidal_momentum_derivatives", "centroidal_momentum", robot)
