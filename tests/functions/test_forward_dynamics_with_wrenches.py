"""Accelerations under external wrenches against Pinocchio's fext and back to torques."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, ARMS, EVERY, bench, matches_pinocchio
from wide_robots import is_pinocchios

from psdmc.errors import InputError


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_dynamics_with_wrenches", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("forward_dynamics_with_wrenches", "small", 1e-9, in_c=True)


@pytest.mark.parametrize("robot", ARMS)
def test_torques_under_the_wrenches_lead_back(robot: str) -> None:
    own = bench(robot)
    g = own.given
    tau = own.robot.inverse_dynamics_with_wrenches(g["q"], g["qd"], g["qdd"], g["wrenches"])
    found = own.robot.forward_dynamics_with_wrenches(g["q"], g["qd"], tau, g["wrenches"])
    np.testing.assert_allclose(found, g["qdd"], atol=1e-10 * np.abs(g["qdd"]).max())


def test_a_mass_matrix_that_is_not_positive_definite_leaves_nan() -> None:
    own = bench(ARM)
    inputs = [own.given[name] for name in ("q", "qd", "tau", "wrenches")]
    assert np.isnan(own.robot.forward_dynamics_with_wrenches(*inputs, -np.asarray(own.model.theta_b))).all()


def test_a_wrong_shape_is_refused() -> None:
    own = bench(ARM)
    q, qd, tau, wrenches = (own.given[name] for name in ("q", "qd", "tau", "wrenches"))
    with pytest.raises(InputError, match="wrenches"):
        own.robot.forward_dynamics_with_wrenches(q, qd, tau, wrenches[..., :5])
