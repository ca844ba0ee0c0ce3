"""Impacts along a direction: products with dense systems of Pinocchio's numbers."""

from __future__ import annotations

import pytest
from against_pinocchio import INTERPRETED, matches_pinocchio, program_matches_pinocchio
from wide_robots import is_pinocchios

NAME = "impulse_jvp"


def test_it_is_the_product() -> None:
    """test_constrained_forward_dynamics.py does the same on trees, with every mask."""
    matches_pinocchio(NAME, "sliding")


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_the_product(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


def test_joints_of_several_coordinates() -> None:
    is_pinocchios(NAME, "small", 1e-8, in_c=False)
