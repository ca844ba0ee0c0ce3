"""Joints of several coordinates against Pinocchio's, and against motions that are integrated in small steps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

from psdmc.robot.joints import FREE, JOINT_TYPES, PLANAR, SPHERICAL, TRANSLATION, WIDE_TYPES, JointType

COUNT = 30
wide = pytest.mark.parametrize("joint", WIDE_TYPES.values(), ids=repr)


def theirs(joint: JointType) -> pin.Model:
    model = pin.Model()
    model.addJoint(0, getattr(pin, f"JointModel{joint.pinocchio}")(), pin.SE3.Identity(), "joint")
    return model


def positions(joint: JointType, seed: int = 0) -> np.ndarray:
    """(COUNT, nq) anywhere."""
    drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, (joint.nq, COUNT))
    return np.ascontiguousarray(joint.normalized(drawn).T)


def steps(joint: JointType) -> np.ndarray:
    """(COUNT, nv), from nothing at all over the smallest to nearly half a turn."""
    drawn = np.random.default_rng(1).uniform(-1.0, 1.0, (COUNT, joint.nv))
    sizes = np.array([0.0, 1e-12, 1e-8, 1e-5, 0.9e-4, 1.1e-4, 1e-3, 9e-3, 1.1e-2, 0.1, 1.0, 1.7])
    return drawn * np.resize(sizes, COUNT)[:, None]


def integrated(joint: JointType, q: np.ndarray, step: np.ndarray) -> np.ndarray:
    return np.stack(joint.integrated(list(q.T), list(step.T)), axis=-1)


def difference(joint: JointType, q: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.stack(joint.difference(list(q.T), list(other.T)), axis=-1)


def homogeneous(joint: JointType, q: np.ndarray) -> np.ndarray:
    place = joint.transform(q)
    return np.block([[place.rotation, place.translation[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def generator(joint: JointType, step: np.ndarray) -> np.ndarray:
    found = np.zeros((4, 4))
    for (linear, (x, y, z)), rate in zip(joint.twists, step, strict=True):
        found[:3, :3] += rate * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        found[:3, 3] += rate * np.array(linear)
    return found


@wide
def test_transform_subspace_and_sizes_are_pinocchios(joint: JointType) -> None:
    model = theirs(joint)
    data = model.createData()
    for q in positions(joint):
        pin.forwardKinematics(model, data, q)
        assert_allclose(homogeneous(joint, q), data.oMi[1].homogeneous, atol=1e-15)
    subspace = np.array([[*linear, *angular] for linear, angular in joint.twists]).T
    np.testing.assert_array_equal(subspace, np.reshape(data.joints[1].S, (6, -1)))
    assert (joint.nq, joint.nv) == (model.nq, model.nv) == (len(joint.neutral), len(joint.twists))
    assert_allclose(joint.neutral, pin.neutral(model), atol=0)
    np.testing.assert_array_equal(homogeneous(joint, np.array(joint.neutral)), np.eye(4))


@wide
def test_integration_is_pinocchios(joint: JointType) -> None:
    model, q, dq = theirs(joint), positions(joint), steps(joint)
    expected = np.array([pin.integrate(model, *row) for row in zip(q, dq, strict=True)])
    assert_allclose(integrated(joint, q, dq), expected, atol=3e-15)


@wide
def test_integration_follows_constant_rates(joint: JointType) -> None:
    """In closed form: the matrix exponential of the twist."""
    for q, dq in zip(positions(joint), steps(joint), strict=True):
        moved = homogeneous(joint, q) @ expm(generator(joint, dq))
        assert_allclose(homogeneous(joint, integrated(joint, q, dq)), moved, atol=2e-14)


@wide
def test_the_difference_brings_one_to_the_other_and_is_pinocchios(joint: JointType) -> None:
    model = theirs(joint)
    for q, other in ((positions(joint), positions(joint, 2)), (positions(joint),) * 2):
        found = difference(joint, q, other)
        expected = np.array([pin.difference(model, *row) for row in zip(q, other, strict=True)])
        assert_allclose(found, expected, atol=1e-13)
        for here, step, there in zip(q, found, other, strict=True):
            end = integrated(joint, here, step)
            assert_allclose(homogeneous(joint, end), homogeneous(joint, there), atol=1e-13)


@wide
def test_small_steps_come_back_from_their_end(joint: JointType) -> None:
    q, dq = positions(joint), steps(joint)
    assert_allclose(difference(joint, q, integrated(joint, q, dq)), dq, atol=2e-15, rtol=1e-13)


@wide
def test_nothing_is_lost_where_coordinates_are_normalized(joint: JointType) -> None:
    q = positions(joint)
    assert_allclose(joint.normalized(q.T), q.T, atol=2e-16)
    assert joint.normalized(np.ones((joint.nq, 3), np.longdouble)).dtype == np.longdouble


@pytest.mark.parametrize(
    ("joint", "count"), [(FREE, 0), (SPHERICAL, 1), (PLANAR, 1), (TRANSLATION, 6)], ids=repr
)
def test_how_many_parameters_a_wide_joint_hides(joint: JointType, count: int) -> None:
    assert joint.hidden == count


def test_how_many_parameters_an_axis_hides() -> None:
    """Known since Gautier and Khalil 1990: three, and six where it slides."""
    assert [joint.hidden for joint in JOINT_TYPES.values()] == [3, 6]
