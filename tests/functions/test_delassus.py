"""The Delassus matrix against Pinocchio, and against the inverse of the mass matrix."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("delassus", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_it_is_seen_through_the_inverse_mass_matrix(robot: str) -> None:
    own = bench(robot)
    q = own.given["q"]
    rows = own.robot.contact_jacobian(q)
    expected = rows @ own.model.mass_matrix_inverse(q) @ np.swapaxes(rows, -1, -2)
    found = own.robot.delassus(q)
    assert np.array_equal(found, np.swapaxes(found, -1, -2))
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())
