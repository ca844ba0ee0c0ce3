"""What a user can get wrong in a robot file: one line that names what and where, and a hint."""

from __future__ import annotations

import pytest
from installed import in_wheel
from small_robots import load_dh, load_urdf
from urdf_text import INERTIAL, joint, link

from psdmc.errors import InputError
from psdmc.robot.load import load_robot, load_robot_text

ARM = (link("base"), link("arm"), joint("shoulder", "base", "arm"))


def refused(call, *arguments, **options):
    """The InputError of a call, its message checked for shape."""
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    error = caught.value
    assert "\n" not in error.message
    assert error.hint
    assert "\n" not in error.hint
    return error


def message(*parts, **options):
    return refused(load_urdf, *parts, **options).message


def text_message(text, source_format="urdf"):
    return refused(load_robot_text, text, source_format, source_name="arm.urdf").message


def test_a_missing_file(tmp_path):
    assert "no.urdf: no such file" in refused(load_robot, tmp_path / "no.urdf").message


def test_a_folder(tmp_path):
    assert "cannot be read" in refused(load_robot, tmp_path).message


@pytest.mark.parametrize("name", ["arm.urdf", "arm.toml"])
def test_an_empty_file(tmp_path, name):
    (tmp_path / name).write_text(" \n")

    assert refused(load_robot, tmp_path / name).message == f"{name}: the file is empty"


def test_a_binary_file(tmp_path):
    (tmp_path / "arm.urdf").write_bytes(b"\xff\xfe\x00\x80")

    assert "not a UTF-8 text" in refused(load_robot, tmp_path / "arm.urdf").message


def test_not_xml():
    assert text_message("solid arm").startswith("arm.urdf: not well-formed XML: ")
    assert text_message("<robot><link></robot>").startswith("arm.urdf: not well-formed XML: ")


def test_other_xml():
    assert text_message("<sdf/>") == "arm.urdf: the root element is <sdf>, expected <robot>"
    assert "xacro" in text_message(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro/></robot>'
    )
    assert text_message("<robot/>") == "arm.urdf: no <link> in it"


def test_an_entity_bomb():
    bomb = '<!DOCTYPE robot [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;&a;">]><robot name="&b;"/>'

    assert "XML entities are not allowed" in text_message(bomb)


def test_an_external_entity(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("secret words")
    text = f'<!DOCTYPE robot [<!ENTITY x SYSTEM "file://{secret}">]><robot name="arm">&x;</robot>'

    found = text_message(text)

    assert "XML entities are not allowed" in found
    assert "secret words" not in found


def test_unknown_links():
    assert message(*ARM, base="bass") == "arm.urdf: base link 'bass' does not exist"
    assert message(*ARM, tip="tool") == "arm.urdf: tip link 'tool' does not exist"
    found = message(link("base"), joint("shoulder", "base", "arm"), joint("elbow", "hip", "base"))
    assert "joint 'shoulder': child link 'arm' does not exist" in found
    assert "joint 'elbow': parent link 'hip' does not exist" in found


def test_a_tip_that_is_not_below_the_base():
    assert "tip link 'base' is not below base link 'arm'" in message(*ARM, base="arm", tip="base")


def test_a_link_with_two_parents():
    found = message(*ARM, joint("second", "base", "arm"))

    assert found == "arm.urdf: link 'arm' is the child of joints 'shoulder' and 'second': a loop"


def test_a_ring():
    ring = (link("a"), link("b"), joint("ab", "a", "b"), joint("ba", "b", "a"))

    assert message(*ARM, *ring) == "arm.urdf: links 'a', 'b' form a loop"
    assert message(*ring) == "arm.urdf: links 'a', 'b' form a loop"


def test_two_roots():
    assert message(*ARM, link("stray")) == "arm.urdf: links 'base', 'stray' all have no parent joint"


def test_names_used_twice_or_not_at_all():
    found = message(
        *ARM, link("arm"), '<link/><joint type="fixed"><parent link="arm"/><child link="x"/></joint>'
    )

    assert "2 links are called 'arm'" in found
    assert "a link has no name" in found
    assert "a joint has no name" in found


def test_control_characters_in_names():
    found = message(*ARM, link("a&#10;b"), joint("x", "arm", "a&#10;b"))

    assert found == "arm.urdf: link name 'a\\nb' has control characters"
    assert r"joint name 'a\nb' has control characters" in refused(load_dh, r'name = "a\nb"').message


def test_no_movable_joint():
    fixed = (link("base"), link("arm"), joint("mount", "base", "arm", kind="fixed"))

    assert "no movable joint below link 'base'" in message(*fixed)
    assert "no movable joint between 'base' and 'arm'" in message(*fixed, tip="arm")


def test_a_zero_axis():
    found = message(link("base"), link("arm"), joint("shoulder", "base", "arm", axis="0 0 0"))

    assert found == "arm.urdf: joint 'shoulder': <axis> is zero, expected a direction"


@pytest.mark.parametrize("word", ["nan", "inf", "1_0", "one", ""])
def test_numbers_that_are_none(word):
    found = message(
        link("base"),
        link("arm", INERTIAL.replace('value="1.5"', f'value="{word}"')),
        joint("shoulder", "base", "arm", xyz=f"0 {word} x"),
    )

    assert f"link 'arm': <mass> value='{word}', expected a finite number" in found
    assert f"joint 'shoulder': <origin> xyz='0 {word} x', expected 3 finite numbers" in found


def test_negative_and_missing_masses_all_at_once():
    found = message(
        link("base", INERTIAL.replace('<mass value="1.5"/>', "")),
        link("arm", INERTIAL.replace('value="1.5"', 'value="-1.5"')),
        link("hand", INERTIAL.replace('ixy="0.001"', "")),
        joint("shoulder", "base", "arm"),
        joint("wrist", "arm", "hand"),
    )

    assert "link 'base': <mass> is missing" in found
    assert "link 'arm': <mass> is -1.5 kg, expected no less than zero" in found
    assert "link 'hand': <inertia> has no ixy" in found


def test_bad_joints_are_named_all_at_once():
    found = message(
        *(link(name) for name in ("base", "a", "b", "c", "d")),
        joint("one", "base", "a", kind="spherical"),
        joint("two", "a", "b", kind="screw"),
        joint("three", "b", "c", extra='<limit effort="1" velocity="1"/><mimic joint="two"/>'),
        joint("four", "c", "d", kind="hinge"),
    )

    assert found == (
        "arm.urdf: joint 'one': type 'spherical' is not supported; "
        "joint 'two': type 'screw' is not supported; "
        "joint 'four': type 'hinge' is not supported"
    )


def test_one_of_two_arms_needs_a_tip():
    parts = (*ARM, link("other"), joint("other_shoulder", "base", "other"))

    assert message(*parts, base="base") == "arm.urdf: several chains end in 'arm', 'other'"
    assert load_urdf(*parts, tip="other").chain.joint_names == ("other_shoulder",)


def test_an_arm_of_a_dual_arm_robot_of_the_wheel_needs_a_tip():
    error = refused(lambda path: load_robot(path, base="base"), in_wheel("baxter.urdf"))
    assert "several chains end in" in error.message


def test_options_out_of_range():
    assert "gravity [0, 0] is not three finite numbers" in message(*ARM, gravity=(0, 0))
    assert "snap is 1.0 rad, expected 0 to 0.1" in message(*ARM, snap=1.0)
    assert "snap is nan rad" in message(*ARM, snap=float("nan"))


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("name = 3", "joint 'joint1': name: found 3, expected a text"),
        ('name = "j"\ntype = "ball"', "joint 'j': type: found 'ball', expected one of revolute, prismatic"),
        ('name = "j"\na = nan', "joint 'j': a: found nan, expected a finite number"),
        ('name = "j"\na = true', "joint 'j': a: found True, expected a finite number"),
        ('name = "j"\nalpha = "90"', "joint 'j': alpha: '90' is no angle: write radians, or \"90 deg\""),
        ('name = "j"\nalhpa = 0.0', "joint 'j': unknown key 'alhpa'"),
        ('name = "j"\nlink = { mass = -1.0 }', "joint 'j' link: mass: found -1, expected no less than zero"),
        ('name = "j"\nlink = { mass = inf }', "joint 'j' link: mass: found inf, expected a finite number"),
        ('name = "j"\nlink = { com = [0, 0] }', "joint 'j' link: com: found [0, 0], expected three numbers"),
        ('name = "j"\nlink = { zero = ["mw"] }', "joint 'j' link: zero: unknown mw"),
        ('name = "j"\nlink = 3', "joint 'j' link: found 3, expected a table"),
        ('name = "j"\nlink = { inertia_com = { xx = nan } }', "joint 'j' link inertia_com: xx: found nan"),
        ('name = "j"\nlimits = { position = [1, 0] }', "joint 'j' limits: position: found [1, 0], expected"),
        ('name = "j"\ndrive_inertia = "some"', "joint 'j': drive_inertia: found 'some', expected"),
    ],
)
def test_what_can_be_wrong_in_a_dh_row(row, expected):
    assert f"arm.toml: {expected}" in refused(load_dh, row).message


def test_what_can_be_wrong_in_a_dh_file():
    assert text_message("a = = 1", "dh").startswith("arm.urdf: not a TOML file: ")
    assert text_message('name = "arm"', "dh") == "arm.urdf: no [[joint]] in it"
    assert "2 joints are called 'j'" in refused(load_dh, 'name = "j"', 'name = "j"').message
    assert "convention: found 'craig'" in refused(load_dh, 'name = "j"', convention="craig").message
    assert "--base and --tip name links of a URDF" in refused(load_dh, 'name = "j"', tip="link1").message


def test_inertias_no_body_can_have_are_noted_by_link_and_condition():
    flat = INERTIAL.replace('izz="0.025"', 'izz="0.06"')
    negative = INERTIAL.replace('ixx="0.02"', 'ixx="-0.02"')
    massless = INERTIAL.replace('value="1.5"', 'value="0"')
    loaded = load_urdf(
        *(link(name, inertial) for name, inertial in (("base", flat), ("arm", negative), ("hand", massless))),
        joint("shoulder", "base", "arm"),
        joint("wrist", "arm", "hand"),
    )

    notes = loaded.chain.notes
    assert notes[0].startswith("link 'base': principal moments break the triangle inequality (")
    assert notes[1].startswith("link 'arm': negative principal moment of inertia -0.02")
    assert "link 'hand': inertia without mass: not physical" in notes
