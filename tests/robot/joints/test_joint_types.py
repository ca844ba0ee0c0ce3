"""Each joint type against closed forms, Pinocchio's joint and MuJoCo's."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest
from helical import HELICAL, PITCH

from psdmc.robot.joints import JOINT_TYPES, PRISMATIC, REVOLUTE, URDF_TYPES, JointType, joint_type

TYPES = [*JOINT_TYPES.values(), HELICAL]
POSITIONS = (-2.3, 0.0, 0.4, 1.9)
STEP = 1e-6
"""rad or m, of the central difference: its error is of order STEP^2, rounding's 1e-10."""


def matrix(joint: JointType, q: float) -> np.ndarray:
    place = joint.transform(q)
    return np.block([[place.rotation, place.translation[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]])


def pinocchio_joint(joint: JointType) -> tuple[pin.Model, pin.Data]:
    made = getattr(pin, f"JointModel{joint.pinocchio}")
    model = pin.Model()
    model.addJoint(0, made(PITCH) if joint is HELICAL else made(), pin.SE3.Identity(), "joint")
    return model, model.createData()


@pytest.mark.parametrize("joint", TYPES, ids=repr)
@pytest.mark.parametrize("q", POSITIONS)
def test_the_twist_is_the_derivative_of_the_transform(joint: JointType, q: float) -> None:
    slope = (matrix(joint, q + STEP) - matrix(joint, q - STEP)) / (2 * STEP)
    generator = np.linalg.inv(matrix(joint, q)) @ slope
    (twist,) = joint.twists
    (x, y, z), linear = twist[1], twist[0]
    expected = np.zeros((4, 4))
    expected[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    expected[:3, 3] = linear
    np.testing.assert_allclose(generator, expected, atol=1e-9)


@pytest.mark.parametrize("q", POSITIONS)
def test_transforms_in_closed_form(q: float) -> None:
    c, s = np.cos(q), np.sin(q)
    np.testing.assert_array_equal(
        matrix(REVOLUTE, q), [[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    )
    np.testing.assert_array_equal(
        matrix(PRISMATIC, q), [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, q], [0, 0, 0, 1]]
    )


@pytest.mark.parametrize("joint", TYPES, ids=repr)
def test_transform_subspace_and_sizes_are_pinocchios(joint: JointType) -> None:
    model, data = pinocchio_joint(joint)
    for q in POSITIONS:
        pin.forwardKinematics(model, data, np.array([q]))
        np.testing.assert_allclose(matrix(joint, q), data.oMi[1].homogeneous, atol=1e-15)
    subspace = np.array([[*linear, *angular] for linear, angular in joint.twists]).T
    np.testing.assert_array_equal(subspace, np.reshape(data.joints[1].S, (6, -1)))
    assert (joint.nq, joint.nv) == (model.nq, model.nv)
    assert len(joint.twists) == joint.nv


@pytest.mark.parametrize("joint", JOINT_TYPES.values(), ids=repr)
def test_mujocos_joint_moves_a_body_likewise(joint: JointType) -> None:
    text = (
        '<mujoco><compiler angle="radian"/><worldbody><body><geom size="0.1"/>'
        f'<joint type="{joint.mujoco}" axis="0 0 1"/></body></worldbody></mujoco>'
    )
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.7
    mujoco.mj_kinematics(model, data)
    place = joint.transform(0.7)
    np.testing.assert_allclose(data.xmat[1].reshape(3, 3), place.rotation, atol=1e-15)
    np.testing.assert_allclose(data.xpos[1], place.translation, atol=1e-15)


@pytest.mark.parametrize("word", URDF_TYPES)
def test_a_urdf_joint_moves_as_pinocchio_reads_it(word: str) -> None:
    text = (
        '<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        f'<joint name="j" type="{word}"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
        '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint></robot>'
    )
    model = pin.buildModelFromXML(text)
    data = model.createData()
    kind = URDF_TYPES[word]
    own = kind.normalized(np.linspace(0.7, -0.4, kind.nq)) if kind.nq > 1 else np.array([0.7])
    q = np.array([np.cos(0.7), np.sin(0.7)]) if model.nq == 2 else own
    pin.forwardKinematics(model, data, q)
    np.testing.assert_allclose(matrix(kind, own if kind.nq > 1 else 0.7), data.oMi[1].homogeneous, atol=1e-15)


def basis_values(joint: JointType, q: np.ndarray, count: int | None = None) -> np.ndarray:
    powers = np.array(joint.basis.exponents[:count])
    return np.prod(np.stack([q, np.sin(q), np.cos(q)], axis=-1)[:, None] ** powers, axis=-1)


@pytest.mark.parametrize("joint", JOINT_TYPES.values(), ids=repr)
def test_the_transform_is_a_sum_of_its_basis_functions_of_degree_one(joint: JointType) -> None:
    q = np.linspace(-2.0, 2.0, 17)
    entries = np.array([matrix(joint, value).ravel() for value in q])
    functions = basis_values(joint, q, joint.basis.linear)
    rest = entries - functions @ np.linalg.lstsq(functions, entries, rcond=None)[0]
    assert np.abs(rest).max() < 1e-14


@pytest.mark.parametrize("joint", JOINT_TYPES.values(), ids=repr)
def test_products_of_two_basis_functions_are_sums_of_basis_functions(joint: JointType) -> None:
    q = np.linspace(-2.0, 2.0, 17)
    linear, functions = basis_values(joint, q, joint.basis.linear), basis_values(joint, q)
    products = (linear[:, :, None] * linear[:, None, :]).reshape(len(q), -1)
    rest = products - functions @ np.linalg.lstsq(functions, products, rcond=None)[0]
    assert np.abs(rest).max() < 1e-13
    assert np.linalg.matrix_rank(functions) == joint.basis.size == len(joint.basis.nodes)


@pytest.mark.parametrize("joint", JOINT_TYPES.values(), ids=repr)
def test_derivatives_of_basis_functions(joint: JointType) -> None:
    q = np.linspace(-2.0, 2.0, 9)
    slope = (basis_values(joint, q + STEP) - basis_values(joint, q - STEP)) / (2 * STEP)
    values = basis_values(joint, q)
    for digit, images in enumerate(joint.basis.derivatives):
        expected = sum((factor * values[:, image] for image, factor in images), np.zeros_like(q))
        np.testing.assert_allclose(slope[:, digit], expected, atol=1e-9)


def test_units_belong_to_each_other() -> None:
    metres = {"rad": 0, "m": 1, "N m": 2, "N": 1}
    for joint in TYPES:
        assert metres[joint.position_unit] == joint.length_order
        assert metres[joint.effort_unit] == joint.effort_order
        assert joint.drive_order == {0: 2, 1: 0}[joint.length_order]
    assert [joint.comes_round for joint in TYPES] == [True, False, False]


def test_types_are_found_by_their_words() -> None:
    assert [joint_type(word).word for word in JOINT_TYPES] == list(JOINT_TYPES)
    with pytest.raises(ValueError, match="'ball'"):
        joint_type("ball")


@pytest.mark.parametrize("joint", JOINT_TYPES.values(), ids=repr)
def test_a_copied_type_is_the_type(joint: JointType) -> None:
    assert pickle.loads(pickle.dumps(joint)) == copy.deepcopy(joint) == joint
    assert hash(copy.deepcopy(joint)) == hash(joint)
    assert len({*JOINT_TYPES.values()}) == len(JOINT_TYPES)
