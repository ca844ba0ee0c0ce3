"""Jacobians along the frames' own axes against Pinocchio and against frame_jacobian."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio
from wide_robots import is_pinocchios


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("frame_jacobian_local", robot, real)


def test_it_is_pinocchios_where_joints_have_several_coordinates() -> None:
    is_pinocchios("frame_jacobian_local", "small", 1e-11, in_c=True)


@pytest.mark.parametrize("robot", ARMS)
def test_turned_into_the_bases_axes_it_is_frame_jacobian(robot: str) -> None:
    own = bench(robot)
    q = own.given["q"]
    rotation, found = own.robot.forward_kinematics(q).rotation, own.robot.frame_jacobian_local(q)
    turned = np.einsum("kfij,kfpjl->kfpil", rotation, found.reshape(*found.shape[:2], 2, 3, -1))
    np.testing.assert_allclose(turned.reshape(found.shape), own.robot.frame_jacobian(q), atol=1e-13)
