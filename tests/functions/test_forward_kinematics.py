"""Positions and rotations of frames against Pinocchio and against a planar arm's closed form."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_poses_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_kinematics", robot, real)


def test_a_planar_arm_is_where_its_angles_say() -> None:
    """two_link: axes along y of the base frame's x z plane or z of its x y plane; lengths from its own joints."""
    own = bench("two_link")
    a1, a2 = (float(np.linalg.norm(p.translation)) for p in _steps(own.model.chain))
    q = own.given["q"]
    found = own.robot.forward_kinematics(q)
    distance = np.sqrt(a1**2 + a2**2 + 2 * a1 * a2 * np.cos(q[:, 1]))
    np.testing.assert_allclose(np.linalg.norm(found.position[:, 0], axis=-1), distance, rtol=1e-13)
    angle = np.arctan2(found.rotation[:, 0, 1, 0], found.rotation[:, 0, 0, 0])
    np.testing.assert_allclose(np.cos(angle - q.sum(axis=1)), 1.0, atol=1e-13)


def _steps(chain):  # type: ignore[no-untyped-def]
    return chain.joints[1].placement, chain.tip
