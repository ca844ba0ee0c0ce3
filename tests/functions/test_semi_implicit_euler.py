"""A step of semi-implicit Euler against Pinocchio, and what many of them do."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio

from psdmc.backends.c.back_end import package_files


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("semi_implicit_euler", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("semi_implicit_euler", robot)


def test_the_step_may_be_one_number_for_all_states() -> None:
    own = bench(ARM)
    states = [own.given[name] for name in ("q", "qd", "tau")]
    found = own.robot.semi_implicit_euler(*states, 0.002)
    for one, other in zip(
        found, own.robot.semi_implicit_euler(*states, np.full(len(states[0]), 0.002)), strict=True
    ):
        assert np.array_equal(one, other)


def test_the_header_says_that_the_step_is_a_number() -> None:
    header = package_files(bench("sliding").package)["include/robot/robot.h"]
    assert "q_next = q + dt qd_next; dt is a number; q_next is 4; qd_next is 4 */" in header


def test_energy_without_torques_stays_but_for_the_steps_length() -> None:
    """Symplectic Euler of first order: the error of a free swing over one second falls with dt."""
    own = bench("sliding")
    errors = []
    for steps in (1000, 4000):
        q, qd = own.given["q"][:5] * 0.1, own.given["qd"][:5] * 0.1
        start = own.robot.kinetic_energy(q, qd) + own.robot.potential_energy(q)
        for _ in range(steps // 10):
            q, qd = own.robot.semi_implicit_euler(q, qd, np.zeros_like(q), 1.0 / steps)
        end = own.robot.kinetic_energy(q, qd) + own.robot.potential_energy(q)
        errors.append(float(np.abs(end - start).max()))
    assert 2.0 < errors[0] / errors[1] < 8.0
