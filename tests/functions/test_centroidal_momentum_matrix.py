"""Momentum about the centre of mass against Pinocchio, and against that about the base."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("centroidal_momentum_matrix", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_momentum_about_the_centre_and_about_the_base(robot: str) -> None:
    """L_O = L_C + c x p, and p is the mass times how the centre moves."""
    own = bench(robot)
    q, qd = own.given["q"], own.given["qd"]
    about = np.einsum("sij,sj->si", own.robot.centroidal_momentum_matrix(q), qd)
    whole, centre = own.robot.momentum(q, qd), own.robot.centre_of_mass(q)
    scale = np.abs(whole).max()
    np.testing.assert_allclose(about[:, :3], whole[:, :3], atol=1e-12 * scale)
    np.testing.assert_allclose(
        about[:, 3:] + np.cross(centre, about[:, :3]), whole[:, 3:], atol=1e-12 * scale
    )
    mass = own.model.chain.parameters[:, 0].sum()
    moving = mass * np.einsum("sij,sj->si", own.robot.com_jacobian(q), qd)
    np.testing.assert_allclose(about[:, :3], moving, atol=1e-12 * scale)
