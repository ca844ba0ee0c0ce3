"""Links of a file as named frames: where Pinocchio puts them, and what is said of those that cannot be frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from bundled import robot_path

from psdmc import load
from psdmc.compiler import compile, derive
from psdmc.errors import InputError
from psdmc.robot.load import load_robot_text
from psdmc.robot.reference import reference

URDF = """<robot name="arm">
  <link name="world"/> <link name="pedestal"/> <link name="eye"/> <link name="hand"/> <link name="tcp"/>
  <link name="camera"/> <link name="finger"/> <link name="nail"/> <link name="wall"/>
  <link name="upper"><inertial><mass value="2"/><origin xyz="0.1 0 0.05"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0.01" iyz="0"/></inertial></link>
  <link name="lower"><inertial><mass value="1"/><origin xyz="0 0.1 0"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="to_pedestal" type="fixed"><parent link="world"/><child link="pedestal"/><origin xyz="0 0 1"/></joint>
  <joint name="to_wall" type="fixed"><parent link="pedestal"/><child link="wall"/></joint>
  <joint name="shoulder" type="revolute"><parent link="pedestal"/><child link="upper"/>
    <origin xyz="0 0.1 0.2" rpy="0.3 0 0.2"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="to_eye" type="fixed"><parent link="upper"/><child link="eye"/>
    <origin xyz="0.05 0 0.3" rpy="0.7 -0.4 1.1"/></joint>
  <joint name="elbow" type="prismatic"><parent link="eye"/><child link="lower"/>
    <origin xyz="0.3 0 0" rpy="1.2 0.1 0"/><axis xyz="0.6 0 0.8"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="to_hand" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="0 0 0.1" rpy="0 0.5 0"/></joint>
  <joint name="to_tcp" type="fixed"><parent link="hand"/><child link="tcp"/><origin xyz="0 0 0.2" rpy="0.2 0 0"/></joint>
  <joint name="to_camera" type="fixed"><parent link="hand"/><child link="camera"/>
    <origin xyz="0.1 0 0" rpy="0 0 0.9"/></joint>
  <joint name="grip" type="prismatic"><parent link="hand"/><child link="finger"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
  <joint name="to_nail" type="fixed"><parent link="finger"/><child link="nail"/></joint>
</robot>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("frames") / "arm.urdf"
    path.write_text(URDF)
    return path


TOOL = (0.01, -0.02, 0.3, 0.4, -0.5, 0.6)


def test_frames_are_where_pinocchio_puts_the_links(arm: Path) -> None:
    """Before the tip, on it, beside it, behind it and on a link in the middle; the tool by Pinocchio's own angles."""
    names = ("camera", "eye", "tcp", "hand", "upper")
    model = derive(arm, base="pedestal", tip="hand", frames=names, tool=TOOL)
    assert [frame.name for frame in model.chain.frames] == [*names, "tool"]
    q = np.random.default_rng(1).normal(size=(20, 2))
    found = compile(model, functions=["forward_kinematics", "frame_jacobian"])
    poses, jacobians = found.forward_kinematics(q), found.frame_jacobian(q)
    whole = pin.buildModelFromXML(URDF)
    data = whole.createData()
    for k, row in enumerate(q):
        full = np.zeros(whole.nq)
        for name, value in zip(("shoulder", "elbow"), row, strict=True):
            full[whole.joints[whole.getJointId(name)].idx_q] = value
        pin.framesForwardKinematics(whole, data, full)
        base = data.oMf[whole.getFrameId("pedestal")]
        placed = [base.inverse() * data.oMf[whole.getFrameId(name)] for name in names]
        placed.append(placed[3] * pin.SE3(pin.rpy.rpyToMatrix(*TOOL[3:]), np.array(TOOL[:3])))
        np.testing.assert_allclose(poses.position[k], [place.translation for place in placed], atol=1e-14)
        np.testing.assert_allclose(poses.rotation[k], [place.rotation for place in placed], atol=1e-14)
    assert not jacobians[:, [1, 4], :, 1].any()  # the elbow does not move what sits before it


def test_saved_models_keep_their_frames_and_old_ones_have_the_tip(arm: Path, tmp_path: Path) -> None:
    model = derive(arm, base="pedestal", tip="hand", frames=["camera", "hand"], tool=TOOL)
    model.save(tmp_path / "arm.npz")
    again = load(tmp_path / "arm.npz")
    assert again.content_hash == model.content_hash
    for one, other in zip(model.chain.frames, again.chain.frames, strict=True):
        assert (one.name, one.joint) == (other.name, other.joint)
        np.testing.assert_array_equal(one.placement.rotation, other.placement.rotation)
    plain = load(Path(__file__).parents[1] / "golden" / "two_link" / "two_link.npz")
    assert [frame.name for frame in plain.chain.frames] == [plain.chain.tip_name]


def test_a_model_without_named_frames_has_the_hash_that_it_always_had(arm: Path) -> None:
    model = derive(arm, base="pedestal", tip="hand")
    assert "frames" not in model.provenance["options"]
    assert model.content_hash == replace(model, mechanism=replace(model.mechanism, frames=())).content_hash


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (["knee"], r"frame 'knee' is no link of the file"),
        (["x\x1b[0m"], r"frame 'x\\x1b\[0m' is no link"),
        (["finger"], r"moves with joint 'grip', which is not between 'pedestal' and the tip 'hand'"),
        (["nail"], r"moves with joint 'grip'"),
        (["wall"], r"'wall' is fixed to the root: no joint moves it"),
        (["pedestal"], r"'pedestal' is fixed to the root"),
        (["tcp", "tcp"], r"frame 'tcp' is named twice"),
        ("tcp", r"frames are 'tcp', expected links' names"),
        ({"tcp": 1}, r"frames are {'tcp': 1}, expected links' names"),
        ({"tcp"}, r"frames are {'tcp'}, expected links' names"),
        (iter(["tcp"]), r"frames are <list_iterator .*>, expected links' names"),
    ],
)
def test_what_cannot_be_a_frame_is_said(frames: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_robot_text(URDF, "urdf", base="pedestal", tip="hand", frames=frames)
    if "twice" not in message and "expected" not in message:
        assert "'camera'" in str(caught.value.hint)
        assert "'nail'" not in str(caught.value.hint)


@pytest.mark.parametrize(
    ("tool", "message"),
    [
        ((1.0, 2.0), "is not six finite numbers"),
        ((0, 0, np.nan, 0, 0, 0), "is not six finite numbers"),
        ((1e9, 0, 0, 0, 0, 0), "tool: 1e"),
    ],
)
def test_a_wrong_tool_is_said(tool: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_robot_text(URDF, "urdf", base="pedestal", tip="hand", tool=tool)


def test_a_link_called_tool_is_not_hidden() -> None:
    text = URDF.replace('"tcp"', '"tool"')
    with pytest.raises(InputError, match="called 'tool' too"):
        load_robot_text(text, "urdf", base="pedestal", tip="hand", frames=["tool"], tool=TOOL)


def test_links_of_a_dh_table_are_frames_too() -> None:
    model = derive(robot_path("scara"), frames=["link2", "link4"], tool=TOOL)
    q = np.random.default_rng(2).normal(size=(5, 4))
    found = compile(model, functions=["forward_kinematics"]).forward_kinematics(q)
    robot = reference(load_robot_text(
        model.provenance["source_text"], "dh", frames=["link2", "link4"], tool=TOOL
    ))  # fmt: skip
    expected = robot.poses(q, ["link2", "link4"])
    np.testing.assert_allclose(found.position[:, :2], expected[:, :2, :3, 3], atol=1e-14)
    with pytest.raises(InputError, match="frame 'link9' is no link"):
        derive(robot_path("scara"), frames=["link9"])


def test_a_load_may_be_given_at_any_frame(arm: Path) -> None:
    """Pinocchio with a body appended at the frame, also on a link in the middle."""
    model = derive(arm, base="pedestal", tip="hand", frames=["camera", "eye"])
    com, inertia = np.array([0.02, 0.1, -0.05]), np.diag([0.02, 0.03, 0.04])
    q, qd, qdd = np.random.default_rng(3).normal(size=(3, 10, 2))
    for name in ("camera", "eye"):
        loaded = model.with_payload(1.5, com, inertia, frame=name)
        robot = reference(
            load_robot_text(URDF, "urdf", base="pedestal", tip="hand", frames=["camera", "eye"])
        )
        frame = robot.model.frames[robot.model.getFrameId(name)]
        robot.model.appendBodyToJoint(frame.parentJoint, pin.Inertia(1.5, com, inertia), frame.placement)
        expected = robot.inverse_dynamics(q, qd, qdd)
        np.testing.assert_allclose(loaded.inverse_dynamics(q, qd, qdd), expected, atol=1e-12)
    with pytest.raises(InputError, match=r"payload frame 'wall' is not the tip 'hand' or another") as caught:
        model.with_payload(1.0, com, frame="wall")
    assert "'camera'" in str(caught.value.hint)
