"""Jacobians of a step of semi-implicit Euler against Pinocchio and against differences of the step."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("semi_implicit_euler_derivatives", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("semi_implicit_euler_derivatives", robot)


@pytest.mark.parametrize("robot", ARMS)
def test_they_are_the_slopes_of_the_step(robot: str) -> None:
    own, n, step = bench(robot), bench(robot).model.n, 1e-6
    names = ("q", "qd", "tau")
    states, dt = [own.given[name][:20] for name in names], own.given["dt"][:20]
    found = own.robot.semi_implicit_euler_derivatives(*states, dt)
    whole = np.concatenate([found.A, found.B], axis=-1)
    for j, unit in enumerate(np.eye(3 * n)):
        moves = [unit[k * n : (k + 1) * n] for k in range(3)]
        ahead, behind = (
            np.concatenate(
                own.robot.semi_implicit_euler(
                    *(x + h * move for x, move in zip(states, moves, strict=True)), dt
                ),
                axis=-1,
            )
            for h in (step, -step)
        )
        slope = (ahead - behind) / (2 * step)
        np.testing.assert_allclose(whole[:, :, j], slope, atol=1e-7 * max(1.0, np.abs(slope).max()))
