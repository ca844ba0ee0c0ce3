"""A step of fourth-order Runge-Kutta against Pinocchio, and its order."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("rk4_step", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("rk4_step", robot)


def test_half_the_step_has_a_sixteenth_of_the_error() -> None:
    """Fourth order, over a tenth of a second of free motion; the truth by steps a tenth as long."""
    own = bench("sliding")
    start = [0.2 * own.given[name][:5] for name in ("q", "qd")]

    def after(steps: int) -> np.ndarray:
        q, qd = start
        for _ in range(steps):
            q, qd = own.robot.rk4_step(q, qd, np.zeros_like(q), 0.1 / steps)
        return np.concatenate([q, qd], axis=1)

    truth = after(400)
    long, short = (np.abs(after(steps) - truth).max() for steps in (10, 20))
    assert 12.0 < long / short < 20.0


def test_a_stage_without_a_positive_mass_matrix_spoils_the_step() -> None:
    own = bench(ARM)
    states = [own.given[name][:9] for name in ("q", "qd", "tau")]
    for output in own.robot.rk4_step(*states, 0.01, theta_b=-np.asarray(own.model.theta_b)):
        assert np.isnan(output).all()
