"""Jacobians of a step of semi-implicit Euler with contacts: from Pinocchio's numbers, and as slopes of the step itself."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import INTERPRETED, SEVERAL, matches_pinocchio, program_matches_pinocchio
from contact_trees import BRICK, brick, contact_tree
from slopes_of import are_slopes
from wide_robots import is_pinocchios

import psdmc
from psdmc.errors import InputError

STEP = "constrained_semi_implicit_euler"
NAME = f"{STEP}_derivatives"


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_they_are_the_dense_systems(robot: str, real: str) -> None:
    """test_constrained_forward_dynamics.py does the same on trees, with every mask."""
    matches_pinocchio(NAME, robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_their_programs_are_the_dense_systems(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


def test_those_of_forces_are_complex_steps() -> None:
    """test_steps_of_free_robots.py does the same for the state."""
    are_slopes(NAME, STEP, "small", 1e-8)


@pytest.mark.parametrize("robot", ["two", "small"])
def test_loops_and_calls_where_joints_have_several_coordinates(robot: str) -> None:
    is_pinocchios(NAME, robot, 1e-8)


def test_the_state_is_that_of_the_step_and_without_contacts_the_jacobians_are_those_without() -> None:
    own = contact_tree(0, True)
    state = [own.given[name] for name in ("q", "qd", "tau", "dt", "active")]
    found, step = getattr(own.robot, NAME)(*state), getattr(own.robot, STEP)(*state)
    for name in ("q_next", "qd_next", "forces"):
        expected = getattr(step, name)
        np.testing.assert_allclose(getattr(found, name), expected, atol=1e-11 * np.abs(expected).max())
    off = own.given["active"].sum(axis=1) == 0
    free = own.model.semi_implicit_euler_derivatives(*(each[off] for each in state[:4]))
    for name in ("A", "B"):
        expected = getattr(free, name)
        np.testing.assert_allclose(getattr(found, name)[off], expected, atol=1e-10 * np.abs(expected).max())
    assert not found.B_error[off].any()


def test_differences_of_the_step_with_every_mask_and_gains() -> None:
    """In C, of a tree on a floating base: central differences along the tangent, with the error held constant."""
    own = contact_tree(0, True)
    given = [own.given[name] for name in ("q", "qd", "tau", "dt", "active", "mu", "kp", "kd", "error")]
    found, nv, size = getattr(own.robot, NAME)(*given), own.model.nv, 1e-6
    whole = np.concatenate([found.A, found.B, found.B_error], axis=-1)

    def after(where: int, way: np.ndarray) -> np.ndarray:
        moved = list(given)
        moved[where] = own.model.integrate(given[0], way) if where == 0 else given[where] + way
        step = getattr(own.robot, STEP)(*moved)
        return np.concatenate([own.model.difference(found.q_next, step.q_next), step.qd_next], axis=1)

    first, largest = 0, np.abs(whole).max(axis=(0, 1))
    for where in (0, 1, 2, 8):
        width = nv if where == 0 else given[where].shape[1]
        for unit in np.eye(width):
            ways = np.broadcast_to(size * unit, (len(given[0]), width))
            slope = (after(where, ways) - after(where, -ways)) / (2.0 * size)
            assert np.abs(whole[:, :, first] - slope).max() < 1e-6 * max(largest[first], 1.0)
            first += 1


def test_too_many_contacts_are_refused() -> None:
    model = brick("edge", "side")
    robot = psdmc.compile(model, functions=[NAME])
    state = (BRICK, np.zeros(6), np.zeros(6), 0.01, [1.0, 1.0])
    for each in (model, robot):
        with pytest.raises(InputError, match="is not positive definite at mu = 0"):
            getattr(each, NAME)(*state)
        assert all(np.isfinite(values).all() for values in getattr(each, NAME)(*state, mu=0.1))
