"""Floating and planar joints of a URDF, anywhere in its tree, against Pinocchio's own reading and MuJoCo's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from small_robots import load_urdf, torques
from urdf_text import joint, link, urdf

from psdmc.compiler import derive
from psdmc.errors import InputError
from psdmc.model.random_states import states_of
from psdmc.robot.joints import FREE, PLANAR, REVOLUTE
from psdmc.robot.load import LoadedRobot, load_robot_text
from psdmc.robot.mujoco_reading import NotCompared, mujoco_torques, mujoco_version
from psdmc.verification.check import check_model

RAFT = (
    link("shore"), link("raft"), link("mast"), link("kite"), link("tail"), link("buoy"),
    joint("adrift", "shore", "raft", kind="floating", rpy="0.3 -0.2 0.4", axis="0 0 0"),
    joint("hinge", "raft", "mast", axis="0.6 0 0.8", rpy="0.3 0.1 -0.2"),
    joint("glide", "mast", "kite", kind="planar", rpy="0.2 0.5 0", axis="0 0 2"),
    joint("flap", "kite", "tail", axis="0 1 0"),
    joint("loose", "raft", "buoy", kind="floating"),
)  # fmt: skip
"""A free joint on the base, whose axis says nothing, a planar one in the middle, and a free one at an end."""


def read(text: str, **options: object) -> LoadedRobot:
    return load_robot_text(text, "urdf", source_name="raft.urdf", **options)  # type: ignore[arg-type]


def assert_is(robot: LoadedRobot, oracle: pin.Model) -> None:
    assert list(oracle.names)[1:] == list(robot.mechanism.joint_names)
    states = states_of(robot.mechanism, np.random.default_rng(3), 20)
    data = oracle.createData()
    expected = np.array([pin.rnea(oracle, data, *state) for state in zip(*states, strict=True)])
    largest = np.abs(expected).max(axis=0)
    assert np.all(np.abs(torques(robot.mechanism, *states) - expected).max(axis=0) <= 1e-12 * largest)


@pytest.mark.parametrize("snap", [0.0, 1e-5])
def test_torques_are_pinocchios(snap: float) -> None:
    robot = read(urdf(*RAFT), snap=snap)
    assert robot.mechanism.types == (FREE, REVOLUTE, PLANAR, REVOLUTE, FREE)
    assert (robot.mechanism.nq, robot.mechanism.nv) == (20, 17)
    assert_is(robot, pin.buildModelFromXML(urdf(*RAFT)))


def test_they_stand_on_a_floating_base_too() -> None:
    oracle = pin.buildModelFromXML(urdf(*RAFT), pin.JointModelFreeFlyer())
    assert_is(read(urdf(*RAFT), floating=True), oracle)


def test_one_may_be_held_where_it_is() -> None:
    whole = pin.buildModelFromXML(urdf(*RAFT))
    held = [whole.getJointId(name) for name in ("glide", "loose")]
    oracle = pin.buildReducedModel(whole, held, pin.neutral(whole))
    assert_is(read(urdf(*RAFT), lock={"glide": 0.0, "loose": 0.0}), oracle)


def test_a_chain_with_one_is_derived_without_E_and_P_and_checked(tmp_path: Path) -> None:
    file = tmp_path / "raft.urdf"
    file.write_text(urdf(*RAFT[:5], *RAFT[6:10]), encoding="utf-8")
    model = derive(file)
    assert model.p is None
    assert model.l == 10 * 4 - 3 * 2 - 1
    rows = check_model(model)
    assert {row.against for row in rows} >= {"rnea", "aba", "computePotentialEnergy"}
    assert all(not row.error > row.limit for row in rows if row.limit is not None)


def test_mujocos_free_joint_agrees() -> None:
    try:
        mujoco_version()
    except NotCompared:
        pytest.skip("MuJoCo is not installed")
    parts = (
        link("shore"),
        *RAFT[1:3],
        joint("adrift", "shore", "raft", kind="floating", xyz="0 0 0"),
        RAFT[7],
    )
    robot = read(urdf(*parts))
    states = states_of(robot.mechanism, np.random.default_rng(5), 20)
    expected = mujoco_torques(robot, *states)
    found = torques(robot.mechanism, *states)
    assert np.all(np.abs(found - expected).max(axis=0) <= 1e-9 * np.abs(expected).max(axis=0))


def test_what_moves_by_several_coordinates_is_said_with_them() -> None:
    notes = load_urdf(*RAFT).mechanism.notes
    assert (
        "link 'kite' moves in a plane by joint 'glide': q: x y (m), cosine and sine of the angle; rates: velocity along its "
        "own x and y (m/s), angular velocity (rad/s); efforts: force (N) and moment (N m)"
    ) in notes
    assert (
        sum(note.startswith("link 'raft' moves freely by joint 'adrift': q: x y z (m)") for note in notes)
        == 1
    )


def message(*parts: str, **options: object) -> tuple[str, str]:
    with pytest.raises(InputError) as refused:
        load_urdf(*parts, **options)
    return str(refused.value), refused.value.hint


@pytest.mark.parametrize("axis", ["1 0 0", "0 0 -1", "0 1e-9 1", None])
def test_a_plane_that_readers_understand_differently_is_refused(axis: str | None) -> None:
    """By the standard the axis, (1, 0, 0) where there is none, is the plane's normal; Pinocchio never reads it."""
    glide = joint("glide", "a", "b", kind="planar", axis=axis or "")
    glide = glide if axis else glide.replace('<axis xyz=""/>', "")
    said, hint = message(link("a"), link("b"), glide)
    assert said.startswith("arm.urdf: joint 'glide' of type 'planar' has <axis> ")
    assert said.endswith(": the plane's normal by the standard, where other readers always take z")
    assert hint == 'write <axis xyz="0 0 1"/>, and turn the plane by rpy of its <origin>'
    load_urdf(*(link(name) for name in "abc"), glide, joint("turn", "b", "c"), lock={"glide": 0.0})


def test_spherical_joints_are_refused_with_a_way_round() -> None:
    said, hint = message(link("a"), link("b"), joint("hip", "a", "b", kind="spherical"))
    assert said == "arm.urdf: joint 'hip': type 'spherical' is not supported"
    assert hint == (
        "psdmc models revolute, continuous, prismatic, floating, planar and fixed joints; a URDF has no joint about every "
        "axis: write it as three revolute ones through one point"
    )


@pytest.mark.parametrize("leads", [True, False])
def test_one_neither_follows_nor_leads(leads: bool) -> None:
    follower = joint("turn", "b", "c", extra='<mimic joint="glide"/>' if leads else "")
    glide = joint("glide", "a", "b", kind="planar", extra="" if leads else '<mimic joint="turn"/>')
    said, hint = message(*(link(name) for name in "abc"), glide, follower)
    assert said == (
        "arm.urdf: joint 'glide' of type 'planar' has several coordinates: such joints neither follow others by <mimic> "
        "nor lead them"
    )
    assert hint == "leave that <mimic> out"
