"""The rate of the centroidal momentum against Pinocchio, the momentum along the motion, and gravity."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio
from wide_robots import is_pinocchios, wide_robot


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("centroidal_momentum_rate", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("centroidal_momentum_rate", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ARMS)
def test_it_is_how_the_momentum_changes_along_the_motion(robot: str) -> None:
    own = bench(robot)
    q, qd, qdd = (own.given[name] for name in ("q", "qd", "qdd"))
    by_q, by_qd = own.robot.centroidal_momentum_derivatives(q, qd)
    expected = np.einsum("kij,kj->ki", by_q, qd) + np.einsum("kij,kj->ki", by_qd, qdd)
    found = own.robot.centroidal_momentum_rate(q, qd, qdd)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_a_robot_that_nothing_holds_falls_and_keeps_its_angular_momentum() -> None:
    own = wide_robot("small")
    falling = own.compiled("forward_dynamics", "centroidal_momentum_rate")
    q, qd, tau = own.given["q"], own.given["qd"], own.given["tau"].copy()
    tau[:, :6] = 0.0
    rate = falling.centroidal_momentum_rate(q, qd, falling.forward_dynamics(q, qd, tau))
    mass = own.model.mechanism.parameters[:, 0].sum()
    expected = np.concatenate([mass * own.model.mechanism.gravity, np.zeros(3)])
    np.testing.assert_allclose(rate, np.broadcast_to(expected, rate.shape), atol=1e-8)
