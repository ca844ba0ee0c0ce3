"""Gradients and directions of forward dynamics with contacts and of impacts: Pinocchio's numbers, and theta_b."""

from __future__ import annotations

import pytest
from against_pinocchio import INTERPRETED, matches_pinocchio, program_matches_pinocchio
from wide_robots import is_pinocchios

NAMES = (
    "constrained_forward_dynamics_vjp",
    "constrained_forward_dynamics_jvp",
    "impulse_vjp",
    "impulse_jvp",
)


@pytest.mark.parametrize("function", NAMES)
def test_they_are_products_with_the_dense_systems(function: str) -> None:
    """test_constrained_forward_dynamics.py does the same on trees, with every mask."""
    matches_pinocchio(function, "sliding")


@pytest.mark.parametrize("function", [*NAMES, "constrained_forward_dynamics_vjp_parameters"])
@pytest.mark.parametrize("robot", INTERPRETED)
def test_their_programs_are_products_with_the_dense_systems(function: str, robot: str) -> None:
    program_matches_pinocchio(function, robot)


@pytest.mark.parametrize("function", NAMES)
def test_joints_of_several_coordinates(function: str) -> None:
    is_pinocchios(function, "small", 1e-8, in_c=False)
