"""A step of semi-implicit Euler with contacts: against dense systems of Pinocchio's numbers, and what many steps do."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import INTERPRETED, SEVERAL, matches_pinocchio, program_matches_pinocchio
from contact_trees import BRICK, brick, contact_tree
from unoptimised import without_optimisation
from wide_robots import is_pinocchios

import psdmc
from psdmc.errors import InputError

NAME = "constrained_semi_implicit_euler"


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    """test_constrained_forward_dynamics.py does the same on trees, with every mask."""
    matches_pinocchio(NAME, robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


def test_a_call_and_a_step_where_joints_have_several_coordinates() -> None:
    is_pinocchios(NAME, "small", 1e-8)


def test_without_contacts_it_is_semi_implicit_euler_and_forces_are_those_of_forward_dynamics() -> None:
    own = contact_tree(0, True)
    q, qd, tau, dt, active = (own.given[name] for name in ("q", "qd", "tau", "dt", "active"))
    found, off = getattr(own.robot, NAME)(q, qd, tau, dt, active), own.given["active"].sum(axis=1) == 0
    free = own.model.semi_implicit_euler(q[off], qd[off], tau[off], dt[off])
    np.testing.assert_allclose(found.q_next[off], free.q_next, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.qd_next[off], free.qd_next, rtol=0, atol=1e-10)
    assert not found.forces[off].any()
    forces = own.robot.constrained_forward_dynamics(q, qd, tau, active).forces
    np.testing.assert_allclose(found.forces, forces, rtol=0, atol=1e-10 * np.abs(forces).max())


def test_stabilisation_pulls_a_displaced_contact_back() -> None:
    """A brick hangs at a point that is 1 cm from its place. With gains k^2 and 2 k, it falls by (1 + k t) exp(-k t), here
    within what the steps' length leaves; without gains, it stays."""
    model = brick("edge")
    with without_optimisation():
        robot = psdmc.compile(model, functions=[NAME, "forward_kinematics"])
    origin = model.forward_kinematics(np.array(BRICK)).position[0] + [0.0, 0.0, 0.01]
    for rate in (0.0, 20.0):
        q, qd, dt = np.array(BRICK), np.zeros(6), 5e-4
        for _ in range(600):
            error = robot.forward_kinematics(q).position[0] - origin
            q, qd, _ = getattr(robot, NAME)(q, qd, np.zeros(6), dt, [1], 0.0, rate**2, 2.0 * rate, error)
        left = robot.forward_kinematics(q).position[0] - origin
        expected = -0.01 * (1.0 + 0.3 * rate) * np.exp(-0.3 * rate)
        np.testing.assert_allclose(left, [0.0, 0.0, expected], rtol=0, atol=2e-4)


def test_too_many_contacts_are_refused_and_every_result_is_nan_in_c() -> None:
    model = brick("edge", "side")
    robot = psdmc.compile(model, functions=[NAME])
    state = (BRICK, np.zeros(6), np.zeros(6), 0.01, [1.0, 1.0])
    for each in (model, robot):
        with pytest.raises(InputError, match="is not positive definite at mu = 0"):
            getattr(each, NAME)(*state)
        assert all(np.isfinite(values).all() for values in getattr(each, NAME)(*state, mu=0.1))
