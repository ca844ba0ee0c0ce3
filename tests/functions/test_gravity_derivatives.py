"""Derivatives of gravity against Pinocchio and against differences of gravity."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("gravity_derivatives", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("gravity_derivatives", robot)


@pytest.mark.parametrize("robot", ARMS)
def test_they_are_the_slopes_of_gravity(robot: str) -> None:
    own = bench(robot)
    q, step = own.given["q"], 1e-5
    found = own.robot.gravity_derivatives(q).dg_dq
    for j, unit in enumerate(np.eye(own.model.n)):
        slope = (own.model.gravity(q + step * unit) - own.model.gravity(q - step * unit)) / (2 * step)
        np.testing.assert_allclose(found[:, :, j], slope, atol=1e-7 * np.abs(found).max())
