"""Derivatives of impacts: dense systems of Pinocchio's numbers, complex steps, and an impact in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import INTERPRETED, SEVERAL, matches_pinocchio, program_matches_pinocchio
from contact_trees import BRICK, brick, contact_tree
from slopes_of import are_slopes
from wide_robots import is_pinocchios

from psdmc.errors import InputError

NAME = "impulse_derivatives"


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_they_are_the_dense_systems(robot: str, real: str) -> None:
    """test_constrained_forward_dynamics.py does the same on trees, with every mask."""
    matches_pinocchio(NAME, robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_their_programs_are_the_dense_systems(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


@pytest.mark.parametrize("robot", ["small", "hand"])
def test_they_are_complex_steps(robot: str) -> None:
    are_slopes(NAME, "impulse", robot, 1e-8)


def test_loops_and_calls_where_joints_have_several_coordinates() -> None:
    is_pinocchios(NAME, "small", 1e-8)


def test_values_are_those_without_derivatives() -> None:
    own = contact_tree(0, True)
    state = [own.given[name] for name in ("q", "qd_before", "active", "restitution")]
    found, plain = own.robot.impulse_derivatives(*state), own.robot.impulse(*state)
    for name in ("qd_after", "impulses"):
        expected = getattr(plain, name)
        np.testing.assert_allclose(getattr(found, name), expected, atol=1e-11 * np.abs(expected).max())


def test_a_brick_that_lands_on_its_centre_of_mass() -> None:
    """A body of 4 kg: the contact reverses half of the velocity, in whatever pose."""
    found = brick("brick").impulse_derivatives(BRICK, [0.3, 0.0, -2.0, 0.0, 0.0, 1.0], [1.0], 0.5)
    np.testing.assert_allclose(found.dqd_after_dqd_before, np.diag([-0.5] * 3 + [1.0] * 3), atol=1e-14)
    np.testing.assert_allclose(found.dimpulses_dqd_before, np.eye(3, 6) * -6.0, atol=1e-13)
    np.testing.assert_allclose(found.dqd_after_dq, 0.0, atol=1e-13)


def test_restitution_is_from_0_to_1() -> None:
    own = contact_tree(0, floating=True)
    state = [own.given[name][0] for name in ("q", "qd_before", "active")]
    for robot in (own.robot, own.model):
        with pytest.raises(InputError, match=r": restitution is 1\.5\nhint: give 0 to 1$"):
            robot.impulse_derivatives(*state, 1.5)
