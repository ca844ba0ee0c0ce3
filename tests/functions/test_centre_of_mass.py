"""The centre of mass against Pinocchio, and against its Jacobian."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("centre_of_mass", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_the_centre_moves_as_its_jacobian_says(robot: str) -> None:
    own = bench(robot)
    q, qd, step = own.given["q"], own.given["qd"], 1e-5
    slope = (own.robot.centre_of_mass(q + step * qd) - own.robot.centre_of_mass(q - step * qd)) / (2 * step)
    expected = np.einsum("sij,sj->si", own.robot.com_jacobian(q), qd)
    np.testing.assert_allclose(slope, expected, atol=1e-6)
