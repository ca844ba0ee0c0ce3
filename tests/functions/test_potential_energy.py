"""Potential energy against Pinocchio and against gravity's torques."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_the_energy_is_pinocchios_but_for_that_at_zero(robot: str, real: str) -> None:
    if not bench(robot).model.gravity(bench(robot).given["q"]).any():
        pytest.skip("gravity acts along no joint of this robot: its energy is constant")
    matches_pinocchio("potential_energy", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_its_slope_is_gravitys_torque_and_it_vanishes_at_zero(robot: str) -> None:
    own = bench(robot)
    q, n, step = own.given["q"], own.model.n, 1e-5
    slopes = [
        (own.robot.potential_energy(q + step * unit) - own.robot.potential_energy(q - step * unit))
        / (2 * step)
        for unit in np.eye(n)
    ]
    expected = own.model.gravity(q)
    np.testing.assert_allclose(np.stack(slopes, axis=1), expected, atol=1e-7 * np.abs(expected).max())
    for theta in (None, own.model.theta_b):
        assert abs(own.robot.potential_energy(np.zeros(n), theta_b=theta)) < 1e-12 * np.abs(expected).max()
