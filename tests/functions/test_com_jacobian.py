"""The Jacobian of the centre of mass against Pinocchio and against momentum over mass."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("com_jacobian", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_the_centre_gives_gravitys_torques(robot: str) -> None:
    """Gravity pulls at the centre of mass: g(q) = -J^T (total mass) (gravity's acceleration)."""
    own = bench(robot)
    chain, q = own.model.chain, own.given["q"]
    weight = chain.parameters[:, 0].sum() * chain.gravity
    found = -np.einsum("sij,i->sj", own.robot.com_jacobian(q), weight)
    expected = own.model.gravity(q)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
