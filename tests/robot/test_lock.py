"""Joints that are held at a position, against Pinocchio's reduced models."""

from __future__ import annotations

import json

import numpy as np
import pinocchio as pin
import pytest
from installed import in_wheel
from small_robots import largest_difference, torques
from urdf_text import LIMIT, joint, link, urdf

from psdmc.compiler import derive
from psdmc.derivation.derive import derive_model, provenance_of
from psdmc.errors import InputError
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.robot.load import LoadedRobot, load_robot, load_robot_text
from psdmc.robot.reference import reference
from psdmc.robot.urdf.dependent_joints import parsed_lock
from psdmc.verification.check import check_model

MIMIC = '<mimic joint="r" multiplier="-2" offset="0.25"/>'
ARM = urdf(
    link("base"), link("one"), link("two"), link("three"), link("left"), link("right"),
    joint("a", "base", "one", rpy="0.3 0.1 -0.2"),
    joint("b", "one", "two", axis="0.6 0 0.8", rpy="1.1 0 0.3"),
    joint("c", "two", "three", kind="prismatic", axis="0 1 0", rpy="0 0.4 0"),
    joint("l", "three", "left", axis="1 0 0", extra=LIMIT + MIMIC),
    joint("r", "three", "right", axis="0 1 0", rpy="0 0 0.7"),
)  # fmt: skip
BARE = ARM.replace(MIMIC, "")


def loaded(lock: dict[str, float], text: str = BARE, **options: object) -> LoadedRobot:
    return load_robot_text(text, "urdf", source_name="arm.urdf", lock=lock, **options)  # type: ignore[arg-type]


def reduced(text: str, held: dict[str, float]) -> pin.Model:
    whole = pin.buildModelFromXML(text.replace('"continuous"', '"revolute"'))
    q = pin.neutral(whole)
    for name, value in held.items():
        q[whole.joints[whole.getJointId(name)].idx_q] = value
    return pin.buildReducedModel(whole, [whole.getJointId(name) for name in held], q)


def model_of(robot: LoadedRobot) -> DynamicsModel:
    return derive_model(robot.mechanism, expand=False, provenance=provenance_of(robot))


def assert_is(robot: LoadedRobot, oracle: pin.Model) -> None:
    assert list(oracle.names)[1:] == list(robot.chain.joint_names)
    data, states = oracle.createData(), np.random.default_rng(1).normal(size=(3, 20, oracle.nv))
    expected = np.array([pin.rnea(oracle, data, *state) for state in zip(*states, strict=True)])
    np.testing.assert_allclose(
        torques(robot.chain, *states), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
    )


@pytest.mark.parametrize(
    "held", [{"b": 0.7}, {"a": -0.4, "c": 0.3}, {"r": 1.2}, {"b": -2.0, "l": 0.5, "r": 0.1}, {"a": 0.0}]
)
@pytest.mark.parametrize("snap", [0.0, 1e-5])
def test_torques_are_those_of_pinocchios_reduced_model(held: dict[str, float], snap: float) -> None:
    robot = loaded(held, snap=snap)
    assert_is(robot, reduced(BARE, held))
    assert largest_difference(robot, snapped=False) < 1e-12


def test_a_follower_of_a_locked_joint_is_locked_where_it_then_is() -> None:
    robot = loaded({"r": 0.4}, ARM)
    assert_is(robot, reduced(BARE, {"r": 0.4, "l": -2 * 0.4 + 0.25}))
    assert "joint 'l' is locked at -0.55" in robot.chain.notes


def test_a_follower_that_is_locked_leaves_its_leader_free() -> None:
    assert_is(loaded({"l": 0.1}, ARM), reduced(BARE, {"l": 0.1}))


def test_a_follower_with_a_multiplier_of_zero_stays_at_its_offset() -> None:
    text = ARM.replace('multiplier="-2"', 'multiplier="0"')
    assert_is(loaded({}, text), reduced(BARE, {"l": 0.25}))


def test_what_is_locked_moves_with_a_chain_and_carries_named_frames() -> None:
    chain = loaded({"b": 0.7, "l": 0.2}, tip="three", frames=("left", "three")).chain
    assert chain.joint_names == ("a", "c")
    oracle = reduced(BARE, {"b": 0.7, "l": 0.2, "r": 0.0})
    data, q = oracle.createData(), np.array([0.3, -0.2])
    pin.framesForwardKinematics(oracle, data, q)
    left = chain.frames[0]
    place = oracle.frames[oracle.getFrameId("left", pin.FrameType.BODY)]
    assert place.parentJoint == left.joint + 1
    own = oracle.frames[oracle.getFrameId("three", pin.FrameType.BODY)].placement
    there = chain.joints[1].link_frame.inverse() @ left.placement
    np.testing.assert_allclose(there.translation, (own.inverse() * place.placement).translation, atol=1e-15)


@pytest.mark.slow
def test_real_robots_with_locked_joints_are_checked_by_both_readers() -> None:
    pytest.importorskip("mujoco")
    path = in_wheel("talos_reduced.urdf")
    lock = {f"leg_{side}_{k}_joint": 0.1 * k for side in ("left", "right") for k in range(1, 7)}
    model = derive(path, lock=lock)
    assert model.n == 20
    rows = check_model(model)
    assert all(row.passed for row in rows)
    assert all(row.limit is not None for row in rows if "MuJoCo" in row.against)
    assert json.loads(json.dumps(model.provenance["options"]))["lock"] == lock


def test_a_locked_branch_leaves_a_chain() -> None:
    held = {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}
    chain = load_robot(in_wheel("panda.urdf"), lock=held).chain
    assert chain.is_serial
    assert len(chain) == 7


@pytest.mark.parametrize("held", [{"l": 0.5, "r": 0.1}, {"a": 0.4, "l": -1.0}, {"b": 1.0, "r": 0.2}])
def test_the_way_to_an_end_leads_over_locked_joints(held: dict[str, float]) -> None:
    """Pinocchio lets frames of joints that it locks hang on themselves; a way over them had no end."""
    robot = loaded(held)
    assert reference(robot, snapped=False).path_length == pytest.approx(4 * np.sqrt(0.14), rel=1e-12)
    assert all(row.passed for row in check_model(model_of(robot)))


@pytest.mark.parametrize("held", [{"r": 0.0}, {"l": 0.0}])
def test_a_joint_of_no_type_of_urdfs_cannot_be_locked(held: dict[str, float], capfd) -> None:
    text = ARM.replace('name="l" type="revolute"', 'name="l" type="spherical"')
    with pytest.raises(
        InputError, match=r"arm.urdf: joint 'l', to be locked, is of type 'spherical'"
    ) as refused:
        loaded(held, text)
    assert refused.value.hint == (
        "types of joints that can be held: 'revolute', 'continuous', 'prismatic', 'floating', 'planar'"
    )
    assert capfd.readouterr().err == ""


def test_models_without_locked_joints_say_nothing_of_them() -> None:
    assert "lock" not in loaded({}).options.as_json()


@pytest.mark.parametrize(
    ("held", "message"),
    [
        ({"z": 0.0}, "arm.urdf: joint 'z', to be locked, does not exist"),
        ({"plate": 0.0}, "arm.urdf: joint 'plate', to be locked, is fixed already"),
        ({"free": 0.1}, "arm.urdf: joint 'free' of type 'floating' is locked at 0.1"),
        ({"a": float("nan")}, "lock is {'a': nan}, expected finite positions"),
        ({"a": "x"}, "lock is {'a': 'x'}, expected finite positions"),
        (["a"], "lock is ['a'], expected positions by joint"),
        ({"a": 0.0, "free": 0.0}, "arm.urdf: no movable joint below link 'base'"),
    ],
)
def test_what_cannot_be_locked(held: dict[str, float], message: str) -> None:
    text = urdf(
        link("base"), link("one"), link("two"), link("three"),
        joint("a", "base", "one"), joint("plate", "one", "two", kind="fixed"),
        joint("free", "two", "three", kind="floating"),
    )  # fmt: skip
    with pytest.raises(InputError) as refused:
        loaded(held, text)
    assert str(refused.value) == message
    assert refused.value.hint


def test_a_floating_joint_may_be_locked_where_it_is() -> None:
    text = urdf(
        link("base"), link("one"), link("two"),
        joint("free", "base", "one", kind="floating"), joint("a", "one", "two"),
    )  # fmt: skip
    assert loaded({"free": 0.0}, text).chain.joint_names == ("a",)


def test_a_position_beyond_the_limits_is_said() -> None:
    assert "joint 'a' is locked at 5, beyond its limits" in loaded({"a": 5.0}).chain.notes


def test_texts_of_the_command_line() -> None:
    assert parsed_lock(["a=0.5", "b=c=-1e-3"]) == {"a": 0.5, "b=c": -1e-3}
    for text in ("a", "a=", "=1", "a=x", "a=nan", "a=inf"):
        with pytest.raises(InputError, match="is no JOINT=VALUE"):
            parsed_lock([text])
    with pytest.raises(InputError, match="names joint 'a' twice"):
        parsed_lock(["a=1", "a=2"])


def test_a_dh_table_has_nothing_to_lock() -> None:
    with pytest.raises(InputError, match="--lock holds joints of a URDF"):
        load_robot_text('[[joint]]\nname = "j"', "dh", lock={"j": 0.0})


@pytest.mark.parametrize("name", ["a", "c"])
def test_positions_far_away_are_refused(name: str) -> None:
    """Sines of 1e9 rad have lost nine digits; before, only a note of the joint's limits told."""
    with pytest.raises(InputError, match=rf"joint '{name}' is to be locked at 1e\+09, which is out of range"):
        loaded({name: 1e9})
    with pytest.raises(InputError, match="tool: 1e\\+06 is out of range"):
        loaded({}, tool=(0, 0, 0, 0, 0, 1e6))


def test_a_follower_that_is_held_alone_is_said() -> None:
    assert "joint 'l' is locked at 0.1, and no longer follows 'r'" in loaded({"l": 0.1}, ARM).chain.notes
    both = loaded({"l": 0.1, "r": 0.0}, ARM).chain.notes
    assert "joint 'l' is locked at 0.1" in both
