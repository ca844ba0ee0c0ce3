"""Names, limits, default tips, notes, and reading a saved source again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from installed import in_wheel
from small_robots import EXAMPLES, largest_difference, load_dh, load_urdf
from urdf_text import joint, link

from psdmc.robot.load import load_robot, load_robot_text
from psdmc.robot.mechanism import Limits


@pytest.mark.parametrize(
    "name",
    ["a; system(&quot;x&quot;)", "größe 关节", "x" * 300, "int", "../../etc", "%s*/ &lt;b&gt;", "same"],
)
def test_names_are_only_text(name):
    loaded = load_urdf(
        link("base"), link(name), link("tip"), joint(name, "base", name), joint("j", name, "tip")
    )

    plain = name.replace("&quot;", '"').replace("&lt;", "<").replace("&gt;", ">")
    assert loaded.chain.joint_names == (plain, "j")
    assert loaded.chain.joints[0].link_name == plain
    assert largest_difference(loaded, snapped=False) < 1e-12


def test_limits_of_a_urdf():
    loaded = load_urdf(
        *(link(name) for name in ("base", "a", "b", "c")),
        joint("j1", "base", "a"),
        joint("j2", "a", "b", kind="continuous"),
        joint("j3", "b", "c", kind="prismatic", extra=""),
    )

    assert [each.limits for each in loaded.chain.joints] == [
        Limits(-1.0, 2.0, 3.0, math.inf, 40.0),
        Limits(-math.inf, math.inf, 3.0, math.inf, 40.0),
        Limits(),
    ]


def test_limits_of_a_dh_table():
    limits = '{ position = ["-90 deg", 1.5], speed = "180 deg", acceleration = 12, effort = 100.0 }'

    assert load_dh(f'name = "j"\nlimits = {limits}').chain.joints[0].limits == Limits(
        -math.pi / 2, 1.5, math.pi, 12.0, 100.0
    )


@pytest.mark.parametrize(
    ("file", "base", "tip", "joints"),
    [
        ("panda.urdf", "panda_link0", "panda_hand", 7),
        ("ur5_robot.urdf", "world", "ee_link", 6),
        ("tiago_no_hand.urdf", "base_footprint", "wrist_ft_tool_link", 8),
        ("b1-z1.urdf", "base", "gripperMover", 7),
    ],
)
def test_where_a_base_is_named_the_default_tip_is_the_end_of_the_arm(file, base, tip, joints):
    chain = load_robot(in_wheel(file), base=base).chain

    assert (chain.base_name, chain.tip_name, len(chain)) == (base, tip, joints)
    assert chain.is_serial


def test_a_gripper_of_two_fingers_ends_the_arm_and_is_said_to():
    notes = load_robot(in_wheel("panda.urdf"), base="panda_link0").chain.notes

    assert any(note.startswith("tip 'panda_hand': there the chain parts towards") for note in notes)
    assert any("locked at zero" in note and "'panda_finger_joint1'" in note for note in notes)


def test_the_frames_of_one_joint_by_hand():
    parts = link("base"), link("arm"), link("tool")
    loaded = load_urdf(
        *parts,
        joint("j", "base", "arm", axis="0 -1 0", xyz="1 2 3"),
        joint("mount", "arm", "tool", kind="fixed", xyz="0.5 0 0"),
    )
    only = loaded.chain.joints[0]

    z_in_base = only.placement.rotation[:, 2]
    assert z_in_base.tolist() == [0.0, -1.0, 0.0]
    assert only.placement.translation.tolist() == [1.0, 2.0, 3.0]
    assert (only.placement.rotation @ only.link_frame.rotation).tolist() == np.eye(3).tolist()
    assert loaded.chain.tip_name == "tool"
    assert (only.placement @ loaded.chain.tip).translation.tolist() == [1.5, 2.0, 3.0]


def test_gravity_of_the_file_and_of_the_caller():
    assert load_robot(EXAMPLES / "denso_wall.toml").chain.gravity.tolist() == [9.81, 0.0, 0.0]
    assert load_robot(EXAMPLES / "kr6.toml", gravity=(0, 1, 0)).chain.gravity.tolist() == [0.0, 1.0, 0.0]


@pytest.mark.parametrize("file", ["denso_wall.toml", "rounded_arm.urdf"])
def test_a_saved_source_reads_back_to_the_same_chain(file):
    options = {"gravity": (0.0, 1.0, -9.0), "drive_inertia": True, "snap": 1e-4}
    first = load_robot(EXAMPLES / file, **options)

    again = load_robot_text(first.source_text, first.source_format, **first.options.as_json())

    for name in ("parameters", "parameter_span", "gravity"):
        assert getattr(again.chain, name).tobytes() == getattr(first.chain, name).tobytes()
    for a, b in zip(again.chain.joints, first.chain.joints, strict=True):
        assert a.placement.rotation.tobytes() == b.placement.rotation.tobytes()
        assert a.placement.translation.tobytes() == b.placement.translation.tobytes()
    assert again.chain.notes == first.chain.notes


def test_pictures_and_extensions_do_not_matter():
    picture = '<visual><geometry><mesh filename="package://nowhere/arm.stl"/></geometry></visual><collision/>'
    extra = '<gazebo reference="arm"><material/></gazebo><transmission name="t"/>'

    loaded = load_urdf(link("base"), link("arm", picture), joint("j", "base", "arm"), extra)

    assert loaded.chain.joint_names == ("j",)


def test_a_byte_order_mark_and_a_declaration_are_fine(tmp_path):
    text = (
        '<?xml version="1.0" encoding="utf-8"?>'
        + load_urdf(link("b"), link("a"), joint("j", "b", "a")).source_text
    )
    (tmp_path / "arm.URDF").write_text(text, encoding="utf-8-sig")

    assert load_robot(tmp_path / "arm.URDF").chain.joint_names == ("j",)
