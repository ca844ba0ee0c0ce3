"""The mass matrix over the joint limits: Pinocchio's own decides what is positive definite."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot

from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.mass_check import check_mass_matrix
from psdmc.robot.reference import reference

ROBOTS = ("denso_floor", "denso_wall", "kr6", "lbr7", "rounded_arm", "scara", "two_link", "two_link_full")


@pytest.mark.parametrize("name", ROBOTS)
def test_every_bundled_robot_passes(name: str):
    found = check_mass_matrix(bundled_model(name))

    assert found is not None
    assert found.passed
    assert found.poses == 2000


def test_the_smallest_eigenvalue_is_pinocchios():
    found = check_mass_matrix(bundled_model("kr6"))
    assert found is not None
    robot = reference(bundled_robot("kr6"))

    mass = robot.mass_matrix(found.pose[None])[0]

    assert float(np.linalg.eigvalsh(mass)[0]) == pytest.approx(found.smallest, rel=1e-9)


def indefinite(name: str) -> DynamicsModel:
    """The last joint's own inertia made negative: one base parameter enters M[-1, -1] alone and constantly."""
    model = bundled_model(name)
    assert model.theta_b is not None
    theta = np.array(model.theta_b)
    theta[-1] = -0.5
    return replace(model, theta_b=theta)


def test_a_negative_inertia_is_found_and_named():
    found = check_mass_matrix(indefinite("kr6"))

    assert found is not None
    assert found.failing == 2000
    assert found.smallest < 0
    assert "not positive definite in 2,000 of 2,000 poses" in found.reason
    assert "q = [" in found.reason
    assert "'joint_6'" in found.reason


def test_poses_keep_the_joint_limits():
    model = bundled_model("scara")
    found = check_mass_matrix(model)

    assert found is not None
    for value, joint in zip(found.pose, model.chain.joints, strict=True):
        assert joint.limits.lower <= value <= joint.limits.upper


def test_unknown_parameters_are_not_tested():
    assert check_mass_matrix(replace(bundled_model("scara"), theta_b=None)) is None
