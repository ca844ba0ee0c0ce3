"""The mass matrix over the joint limits: Pinocchio's own decides what is positive definite."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from bundled import bundled_model, bundled_robot

from psdmc.derivation.derive import derive_model
from psdmc.model import evaluate
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.parameter_checks import check_mass_matrix, is_surely_positive
from psdmc.robot.load import load_robot_text
from psdmc.robot.reference import reference

ROBOTS = ("denso_floor", "denso_wall", "kr6", "lbr7", "rounded_arm", "scara", "two_link", "two_link_full")


@pytest.mark.parametrize("name", ROBOTS)
def test_every_bundled_robot_passes(name: str):
    found = check_mass_matrix(bundled_model(name))

    assert found is not None
    assert found.passed
    assert found.poses == 2000
    assert is_surely_positive(bundled_model(name))


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


def test_cholesky_leaves_to_eigenvalues_what_it_does_not_prove():
    """A negative inertia, unknown parameters, a point on its joint's axis."""
    cases = (indefinite("kr6"), replace(bundled_model("scara"), theta_b=None))
    point = derive_model(load_robot_text(FINGER.format(arm=1, length=0, small=0), "urdf").chain)

    assert not any(map(is_surely_positive, (*cases, point)))


@pytest.mark.parametrize(
    ("matrix", "is_sure"),
    [
        ([[1.0, 0.5], [0.5, 1.0]], True),
        ([[1.0, 2.0], [2.0, 1.0]], False),
        ([[1.0, 1.0 - 1e-15], [1.0 - 1e-15, 1.0]], False),
        ([[1.0, 0.0], [0.0, 1e-30]], False),
    ],
    ids=[
        "eigenvalues 0.5 and 1.5",
        "eigenvalues -1 and 3",
        "an eigenvalue of 1e-15",
        "an inertia of rounding",
    ],
)
def test_cholesky_proves_only_what_eigenvalues_in_closed_form_say(
    monkeypatch: pytest.MonkeyPatch, matrix: list[list[float]], is_sure: bool
):
    """The eigenvalues of [[1, c], [c, 1]] are 1 - c and 1 + c."""
    monkeypatch.setattr(evaluate, "mass_matrix", lambda *_: np.tile(matrix, (2000, 1, 1)))

    assert is_surely_positive(bundled_model("two_link")) == is_sure


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


FINGER = """<robot name="finger"><link name="base"/>
<link name="arm"><inertial><origin xyz="0.5 0 0"/><mass value="{arm}"/>
  <inertia ixx="10" iyy="80" izz="80" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tip"><inertial><origin xyz="{length} 0 0"/><mass value="1e-3"/>
  <inertia ixx="{small}" iyy="{small}" izz="{small}" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="knuckle" type="revolute"><parent link="arm"/><child link="tip"/><origin xyz="1 0 0" rpy="0.3 0.2 0"/>
  <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def test_a_finger_on_a_heavy_arm_has_a_mass_matrix():
    """Inertias of 330 and 2e-15 kg m^2, both there: Pinocchio's Cholesky factor has pivots that multiply to what the
    closed form says."""
    text = FINGER.format(arm=1000, length=1e-6, small=1e-15)
    found = check_mass_matrix(derive_model(load_robot_text(text, "urdf").chain))
    assert found is not None

    model = pinocchio.buildModelFromXML(text)
    mass = pinocchio.crba(model, model.createData(), found.pose)

    assert mass[1, 1] == pytest.approx(2e-15)
    assert mass[0, 0] * mass[1, 1] > 100 * mass[0, 1] ** 2
    assert found.passed


def test_a_joint_that_moves_a_point_on_its_own_axis_has_no_inertia():
    """What turning the point's frame leaves is rounding, however small the rest is."""
    text = FINGER.format(arm=1, length=0, small=0)
    found = check_mass_matrix(derive_model(load_robot_text(text, "urdf").chain))

    assert found is not None
    assert found.failing == 2000
    assert "'knuckle'" in found.reason
