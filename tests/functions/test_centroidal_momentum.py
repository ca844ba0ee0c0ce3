"""The momentum about the centre of mass against Pinocchio and against its matrix."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("centroidal_momentum", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("centroidal_momentum", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ARMS)
def test_it_is_the_matrix_times_qd(robot: str) -> None:
    own = bench(robot)
    q, qd = own.given["q"], own.given["qd"]
    expected = np.einsum("kij,kj->ki", own.robot.centroidal_momentum_matrix(q), qd)
    found = own.robot.centroidal_momentum(q, qd)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
