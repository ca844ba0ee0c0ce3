"""Torques under external wrenches against Pinocchio's fext and against the Jacobian's transpose."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_torques_are_pinocchios_with_fext(robot: str, real: str) -> None:
    matches_pinocchio("inverse_dynamics_with_wrenches", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_a_wrench_takes_off_what_the_jacobian_carries(robot: str) -> None:
    own = bench(robot)
    g = own.given
    turned = own.robot.forward_kinematics(g["q"]).rotation
    wrenches = g["wrenches"].reshape(len(g["q"]), -1, 2, 3)
    in_base = np.einsum("sfij,sfkj->sfki", turned, wrenches).reshape(g["wrenches"].shape)
    carried = np.einsum("sfij,sfi->sj", own.robot.frame_jacobian(g["q"]), in_base)
    states = (g["q"], g["qd"], g["qdd"])
    found = own.robot.inverse_dynamics_with_wrenches(*states, g["wrenches"])
    expected = own.model.inverse_dynamics(*states) - carried
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
