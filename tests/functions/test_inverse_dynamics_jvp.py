"""Torques and their derivatives along a direction, against Pinocchio and difference quotients."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("inverse_dynamics_jvp", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("inverse_dynamics_jvp", robot)


@pytest.mark.parametrize("robot", ARMS)
def test_it_is_the_slope_along_the_direction(robot: str) -> None:
    own, step = bench(robot), 1e-6
    g, call = own.given, own.robot.inverse_dynamics_jvp
    names = ("q", "qd", "qdd")
    directions = [g[f"d{name}"] for name in names]
    ahead, behind = (
        call(*(g[name] + h * g[f"d{name}"] for name in names), *directions)[0] for h in (step, -step)
    )
    found = call(*(g[name] for name in names), *directions)[1]
    np.testing.assert_allclose(found, (ahead - behind) / (2 * step), atol=1e-6 * np.abs(found).max())
