"""Drifts of contacts along their own axes against Pinocchio, and against those along the base's axes."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARMS, EVERY, bench, matches_pinocchio


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    """Surfaces, floating bases and mimic joints are in the test of constrained_forward_dynamics."""
    matches_pinocchio("contact_drift_local", robot, real)


@pytest.mark.parametrize("robot", ARMS)
def test_they_are_turned(robot: str) -> None:
    """Every named frame is a point here."""
    own = bench(robot)
    q, qd = own.given["q"], own.given["qd"]
    turns, aligned = own.robot.forward_kinematics(q).rotation, own.robot.contact_drift(q, qd)
    points = aligned.reshape(*turns.shape[:2], 3, *aligned.shape[2:])
    expected = np.einsum("kfji,kfj...->kfi...", turns, points).reshape(aligned.shape)
    found = own.robot.contact_drift_local(q, qd)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
