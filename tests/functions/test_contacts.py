"""A quadruped on its feet: contact Jacobians, wrenches at them and the centre of mass, by C against Pinocchio."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from pinocchio_robots import path_of
from unoptimised import without_optimisation

import psdmc
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.toolchain.call import CompiledRobot

FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
FUNCTIONS = (
    "frame_jacobian",
    "jacobian_dot_qd",
    "forward_kinematics",
    "inverse_dynamics",
    "inverse_dynamics_with_wrenches",
    "centre_of_mass",
    "com_jacobian",
)
COUNT = 9
EXACT = 1e-12


@cache
def quadruped() -> tuple[DynamicsModel, CompiledRobot, pin.Model]:
    path = path_of("solo12")
    model = psdmc.derive(path, floating=True, frames=list(FEET))
    with without_optimisation():
        robot = psdmc.compile(model, functions=FUNCTIONS)
    return model, robot, pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer())


@cache
def states() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return states_of(quadruped()[0].mechanism, np.random.default_rng(4), COUNT)


def assert_near(found: np.ndarray, expected: np.ndarray) -> None:
    assert np.abs(found - expected).max() <= EXACT * np.abs(expected).max()


def test_contact_jacobians_are_pinocchios_along_the_worlds_axes() -> None:
    _, robot, theirs = quadruped()
    q, _, _ = states()
    data, frames = theirs.createData(), [theirs.getFrameId(name) for name in FEET]
    aligned = pin.LOCAL_WORLD_ALIGNED
    expected = [[pin.computeFrameJacobian(theirs, data, row, f, aligned) for f in frames] for row in q]
    assert robot.frame_names == FEET
    assert_near(robot.frame_jacobian(q), np.array(expected))


def test_a_foot_accelerates_by_jacobian_and_drift() -> None:
    _, robot, theirs = quadruped()
    q, qd, qdd = states()
    data, expected = theirs.createData(), []
    for row in zip(q, qd, qdd, strict=True):
        pin.forwardKinematics(theirs, data, *row)
        pin.updateFramePlacements(theirs, data)
        each = (
            pin.getFrameClassicalAcceleration(theirs, data, theirs.getFrameId(name), pin.LOCAL_WORLD_ALIGNED)
            for name in FEET
        )
        expected.append([acceleration.vector for acceleration in each])
    drift = robot.jacobian_dot_qd(q, qd)
    found = np.einsum("kfij,kj->kfi", robot.frame_jacobian(q), qdd) + drift
    assert_near(found, np.array(expected))


def test_wrenches_at_the_feet_are_taken_off() -> None:
    """Along the feet's own axes; by Pinocchio's fext, and by the transposed Jacobians along the world's."""
    _, robot, theirs = quadruped()
    q, qd, qdd = states()
    wrenches = np.random.default_rng(6).uniform(-20.0, 20.0, (COUNT, len(FEET), 6))
    data, expected = theirs.createData(), []
    for k, row in enumerate(zip(q, qd, qdd, strict=True)):
        pushed = [pin.Force.Zero() for _ in range(theirs.njoints)]
        for name, wrench in zip(FEET, wrenches[k], strict=True):
            frame = theirs.frames[theirs.getFrameId(name)]
            pushed[frame.parentJoint] += frame.placement.act(pin.Force(wrench))
        expected.append(pin.rnea(theirs, data, *row, pushed))
    found = robot.inverse_dynamics_with_wrenches(q, qd, qdd, wrenches)
    assert_near(found, np.array(expected))
    turns = robot.forward_kinematics(q).rotation
    along = np.concatenate(
        [np.einsum("kfij,kfj->kfi", turns, wrenches[..., part]) for part in (slice(3), slice(3, 6))], -1
    )
    lifted = np.einsum("kfij,kfi->kj", robot.frame_jacobian(q), along)
    assert_near(found, robot.inverse_dynamics(q, qd, qdd) - lifted)


def test_standing_feet_carry_the_weight() -> None:
    """Equal forces upwards at all feet that add up to the weight leave no force on the root, moments and joints' torques
    aside."""
    model, robot, theirs = quadruped()
    q, _, _ = states()
    rest = np.zeros((COUNT, model.nv))
    weight = 9.81 * sum(inertia.mass for inertia in theirs.inertias)
    turns = robot.forward_kinematics(q).rotation
    force = np.einsum("kfji,j->kfi", turns, [0.0, 0.0, weight / len(FEET)])
    wrenches = np.concatenate([force, np.zeros_like(force)], axis=-1)
    tau = robot.inverse_dynamics_with_wrenches(q, rest, rest, wrenches)
    np.testing.assert_allclose(tau[:, :3], 0.0, atol=1e-11 * weight)


def test_the_centre_of_mass_and_its_jacobian_are_pinocchios() -> None:
    _, robot, theirs = quadruped()
    q, _, _ = states()
    data = theirs.createData()
    expected = [
        (pin.centerOfMass(theirs, data, row), pin.jacobianCenterOfMass(theirs, data, row)) for row in q
    ]
    assert_near(robot.centre_of_mass(q), np.array([place for place, _ in expected]))
    assert_near(robot.com_jacobian(q), np.array([jacobian for _, jacobian in expected]))


@pytest.mark.parametrize("axis", range(3))
def test_the_jacobians_root_columns_are_its_own_velocities(axis: int) -> None:
    """Independent of Pinocchio: a foot goes with the root's origin, and by w x r when it turns, along its own axes."""
    _, robot, _ = quadruped()
    q, _, _ = states()
    jacobian, place = robot.frame_jacobian(q), robot.forward_kinematics(q).position
    for k in range(COUNT):
        own = pin.Quaternion(q[k, 3:7]).toRotationMatrix()[:, axis]
        np.testing.assert_allclose(jacobian[k, :, :3, axis], np.tile(own, (len(FEET), 1)), atol=1e-14)
        turned = np.cross(own, place[k] - q[k, :3])
        np.testing.assert_allclose(jacobian[k, :, :3, 3 + axis], turned, atol=1e-14)
