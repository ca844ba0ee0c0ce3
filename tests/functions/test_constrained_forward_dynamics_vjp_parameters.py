"""Gradients of forward dynamics with contacts by theta_b: their product with theta_b, and those by the state."""

from __future__ import annotations

import pytest
from against_pinocchio import INTERPRETED, bench, program_matches_pinocchio

NAME = "constrained_forward_dynamics_vjp_parameters"


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    """tests/frameworks compares with differences along a direction of theta_b."""
    program_matches_pinocchio(NAME, robot)
    assert bench(robot).long_kernels[NAME].theta is False
