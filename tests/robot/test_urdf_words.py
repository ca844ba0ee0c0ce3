"""Words of a URDF beyond the plain ones: quaternions, versions, misspelt, misplaced and doubled elements."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from small_robots import largest_difference, load_urdf, torques
from urdf_text import INERTIAL, joint, link

from psdmc.errors import InputError
from psdmc.robot.load import LoadedRobot, load_robot, load_robot_text

PLAIN = (link("base"), link("arm"), joint("shoulder", "base", "arm"))
HALF = math.sqrt(0.5)


def load(text: str) -> LoadedRobot:
    return load_robot_text(text, "urdf", source_name="arm.urdf", snap=0.0)


def robot(*parts: str, version: str | None = None, name: str | None = "arm") -> str:
    said = "" if name is None else f' name="{name}"'
    said += "" if version is None else f' version="{version}"'
    return f"<robot{said}>{''.join(parts)}</robot>"


def refused(text: str) -> InputError:
    with pytest.raises(InputError) as caught:
        load(text)
    assert "\n" not in caught.value.message
    assert caught.value.hint
    return caught.value


def pendulum(origin: str, inertial: str = "", version: str = "1.1") -> str:
    """A point mass of 1 kg at 0.1615 m along the link's x, which turns about the link's z."""
    body = (
        f'<inertial><origin xyz="0.1615 0 0" {inertial}/><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0.01" ixz="0" iyz="0"/></inertial>'
    )
    turn = f'<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><origin {origin}/>'
    return robot(link("base", ""), link("arm", body), turn + '<axis xyz="0 0 1"/></joint>', version=version)


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2"])
def test_a_quaternion_places_a_joint(version: str, capfd: pytest.CaptureFixture[str]):
    """A quarter turn about x makes the axis horizontal: gravity's torque is m g r cos(q)."""
    loaded = load(pendulum(f'quat_xyzw="{HALF} 0 0 {HALF}"', version=version))

    assert torques(loaded.chain, *np.zeros((3, 1, 1)))[0, 0] == pytest.approx(9.81 * 0.1615, rel=1e-12)
    assert largest_difference(loaded, snapped=False) < 1e-12
    assert any("version 1.1" in note for note in loaded.chain.notes) == (version == "1.0")
    assert capfd.readouterr().err == ""


def test_quaternions_are_the_rotations_of_pinocchio():
    x, y, z, w = np.array([0.3, -0.2, 0.6, 0.7]) / math.sqrt(0.98)
    loaded = load(pendulum(f'quat_xyzw="{x} {y} {z} {w}"', f'quat_xyzw="{y} {x} {w} {z}"'))

    expected = pinocchio.Quaternion(np.array([x, y, z, w])).toRotationMatrix()
    np.testing.assert_allclose(loaded.chain.joints[0].placement.rotation, expected, atol=1e-15)
    turn = pinocchio.Quaternion(np.array([y, x, w, z])).toRotationMatrix()
    about_com = turn @ np.array([[0.1, 0.01, 0], [0.01, 0.2, 0], [0, 0, 0.3]]) @ turn.T
    moment = np.array([0.0, 0.1615**2, 0.1615**2])
    np.testing.assert_allclose(loaded.chain.parameters[0, [4, 6, 9]], np.diag(about_com) + moment, rtol=1e-13)
    assert largest_difference(loaded, snapped=False) < 1e-12


def test_a_rounded_quaternion_is_made_one():
    loaded = load(pendulum('quat_xyzw="0 0.707 0 0.707"'))

    np.testing.assert_allclose(loaded.chain.joints[0].placement.rotation @ [1, 0, 0], [0, 0, -1], atol=1e-15)


@pytest.mark.parametrize(
    ("origin", "said"),
    [
        ('quat_xyzw="0 0 0 2"', "<origin> quat_xyzw has length 2, expected one"),
        ('quat_xyzw="0 0 0 0"', "<origin> quat_xyzw has length 0, expected one"),
        ('quat_xyzw="0 0 1"', "<origin> quat_xyzw='0 0 1', expected 4 finite numbers"),
        ('quat_xyzw="0 0 1e155 1"', "<origin> quat_xyzw='0 0 1e155 1' is out of range"),
        ('rpy="0 0 0" quat_xyzw="0 0 0 1"', "<origin> has both rpy and quat_xyzw"),
    ],
)
@pytest.mark.parametrize("place", ["joint 'j'", "link 'arm'"])
def test_quaternions_that_are_none(origin: str, said: str, place: str):
    text = pendulum(origin) if place == "joint 'j'" else pendulum("", origin)

    assert refused(text).message.startswith(f"arm.urdf: {place}: {said}")


@pytest.mark.parametrize("version", ["2.0", "1.3", "0.9", "1", "one", ""])
def test_other_versions_are_refused(version: str, capfd: pytest.CaptureFixture[str]):
    error = refused(robot(*PLAIN, version=version))

    assert error.message == f"arm.urdf: version '{version}' is not supported"
    assert "1.0 to 1.2" in str(error.hint)
    assert capfd.readouterr().err == ""


def test_a_robot_without_a_name_is_called_robot(capfd: pytest.CaptureFixture[str]):
    loaded = load(robot(*PLAIN, name=None))

    assert loaded.chain.name == "robot"
    assert "the file names no robot: called 'robot'" in loaded.chain.notes
    assert capfd.readouterr().err == ""


def test_limits_of_acceleration_of_version_1_2():
    limit = '<limit lower="-1" upper="1" velocity="2" effort="3" acceleration="4" deceleration="5" jerk="6"/>'
    loaded = load(robot(link("base"), link("arm"), joint("j", "base", "arm", extra=limit), version="1.2"))

    assert loaded.chain.joints[0].limits.acceleration == 4.0


@pytest.mark.parametrize(
    ("plain", "changed", "said"),
    [
        ("inertial>", "inertail>", "unknown element <inertail> in <link>: did you mean <inertial>?"),
        ("inertial>", "Inertial>", "unknown element <Inertial> in <link>: did you mean <inertial>?"),
        ("inertial>", "inertials>", "unknown element <inertials> in <link>: did you mean <inertial>?"),
        ('<mass value="1.5"/>', '<mass val="1.5"/>', "<mass> has an unknown attribute 'val' (known: value)"),
        ('<mass value="1.5"/>', '<mass value="1.5" unit="g"/>', "<mass> has an unknown attribute 'unit'"),
        ('<mass value="1.5"/>', '<mas value="1.5"/>', "unknown element <mas> in <inertial>"),
        ('ixy="0.001"', 'ixy="0.001" iyx="0.002"', "<inertia> has an unknown attribute 'iyx'"),
        ('<mass value="1.5"/>', '<mass value="1.5"/><mass value="2"/>', "2 <mass> elements, expected one"),
        ('rpy="0.3 -0.2 0.5"', 'rypt="0.3 -0.2 0.5"', "<origin> has an unknown attribute 'rypt'"),
    ],
)
def test_misspelt_words_of_an_inertial_are_refused(plain: str, changed: str, said: str):
    text = robot(link("base"), link("arm", INERTIAL.replace(plain, changed)), joint("j", "base", "arm"))

    assert f"link 'arm': {said}" in refused(text).message


@pytest.mark.parametrize(
    ("plain", "changed", "said"),
    [
        ("<axis ", "<axes ", "unknown element <axes> in <joint>: did you mean <axis>?"),
        ("<origin ", "<Origin ", "unknown element <Origin> in <joint>: did you mean <origin>?"),
        ("<origin ", "<orgin ", "unknown element <orgin> in <joint>: did you mean <origin>?"),
        (
            "<origin ",
            "<pose/><inertia/><origin ",
            "unknown element <inertia> in <joint>: it does not belong there",
        ),
        ('<axis xyz="0 0 1"/>', "<axis><xyz>0 0 1</xyz></axis>", "unknown element <xyz> in <axis>"),
        ('<axis xyz="0 0 1"/>', "<axis/>", "<axis> has no xyz"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><axis xyz="1 0 0"/>', "2 <axis> elements, expected one"),
        (
            '<parent link="base"/>',
            '<parent link="base" xyz="1 0 0"/>',
            "<parent> has an unknown attribute 'xyz'",
        ),
        ("</joint>", "<mimc joint='x'/></joint>", "unknown element <mimc> in <joint>: did you mean <mimic>?"),
        ("</joint>", '<dynamics damping="a"/></joint>', "<dynamics> damping='a', expected a finite number"),
    ],
)
def test_misspelt_words_of_a_joint_are_refused(plain: str, changed: str, said: str):
    text = robot(link("base"), link("arm"), joint("j", "base", "arm").replace(plain, changed))

    assert f"joint 'j': {said}" in refused(text).message


@pytest.mark.parametrize("word", ["mass", "inertia"])
def test_an_inertial_without_its_bracket_is_refused(word: str):
    text = robot(link("base"), link("arm", f'<{word} value="2"/>'), joint("j", "base", "arm"))

    assert (
        f"link 'arm': unknown element <{word}> in <link>: it does not belong there" in refused(text).message
    )


def test_two_inertials_are_refused():
    text = robot(link("base"), link("arm", INERTIAL + INERTIAL), joint("j", "base", "arm"))

    assert "link 'arm': 2 <inertial> elements, expected one" in refused(text).message


@pytest.mark.parametrize("word", ["Link", "jiont", "inertial"])
def test_misspelt_links_and_joints_are_refused(word: str):
    assert f"unknown element <{word}> in <robot>" in refused(robot(*PLAIN, f"<{word}/>")).message


def test_what_cannot_be_told_is_noted_and_extensions_are_left_alone():
    extensions = (
        '<gazebo><inertial/></gazebo><transmission/><ros2_control name="r"/><material name="m"/>'
        '<x:inertial xmlns:x="urn:x"/><feet/>'
    )
    loaded = load_urdf(
        link("base"),
        link("arm", INERTIAL + '<visual><origin rypt="1"/></visual><kinematic/><origin xyz="1 0 0"/>'),
        joint("j", "base", "arm", extra='<dynamics damping="0.1" friction="0"/><soft/>'),
        extensions,
    )

    assert loaded.chain.notes == (
        "<feet> in <robot> is not read",
        "<kinematic> in <link> is not read",
        "<origin> in <link> is not read",
        "<soft> in <joint> is not read",
        "<dynamics> (damping, friction) of joints is not modelled: 'j'",
    )


def test_dynamics_that_say_nothing_are_not_noted():
    loaded = load_urdf(
        link("base"), link("arm"), joint("j", "base", "arm", extra='<dynamics damping="0.0"/>')
    )

    assert loaded.chain.notes == ()


BODY = f'<link name="base"/><link name="arm">{INERTIAL}</link>'
TURN = '<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>%s</joint>'

LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'

OUTSIDE = {
    "a prefix that nothing declares": (
        '<robot name="r"><!-- <robot> --><sensor:camera name="c" sensor:rate="3"><a:b/></sensor:camera>'
        f"{BODY}{TURN % (LIMIT + '<x:y/>')}</robot>"
    ),
    "one of two prefixes declared": (
        f'<robot name="r" xmlns:a="urn:a"><a:b/><sensor:camera a:x="1"/>{BODY}{TURN % LIMIT}</robot>'
    ),
    "a prefix declared within": f'<robot name="r"><s:c xmlns:s="urn:s"/><s:d/>{BODY}{TURN % LIMIT}</robot>',
    "a default name space": (
        f'<?xml version="1.0"?><robot xmlns="http://www.ros.org" name="r">{BODY}'
        f'<gazebo xmlns="urn:other"><mass/></gazebo>{TURN % LIMIT}</robot>'
    ),
    "a blank first line": f'\n \n<?xml version="1.0"?>\n<robot name="r">{BODY}{TURN % LIMIT}</robot>',
    "a mark and a blank line": f'\ufeff\n<?xml version="1.0"?>\n<robot name="r">{BODY}{TURN % LIMIT}</robot>',
}


@pytest.mark.parametrize("text", OUTSIDE.values(), ids=OUTSIDE)
def test_xml_that_other_readers_take_is_read_as_they_read_it(text: str, tmp_path: Path) -> None:
    """urdfdom, by which Pinocchio reads, knows no name spaces."""
    (tmp_path / "arm.urdf").write_text(text, encoding="utf-8")
    oracle = pinocchio.buildModelFromXML(text.lstrip("\ufeff"))

    robot = load_robot(tmp_path / "arm.urdf")

    assert robot.mechanism.notes == ()
    data, states = oracle.createData(), np.random.default_rng(1).uniform(-3, 3, (3, 5, 1))
    expected = [pinocchio.rnea(oracle, data, *state) for state in zip(*states, strict=True)]
    assert torques(robot.mechanism, *states) == pytest.approx(np.array(expected), rel=1e-13)
    again = load_robot_text(robot.source_text, "urdf", **robot.options.as_json())
    assert np.array_equal(again.mechanism.parameters, robot.mechanism.parameters)


def test_what_dynamics_needs_counts_in_the_files_own_name_space_only() -> None:
    other = f'<robot name="r" xmlns:o="urn:o">{BODY}{TURN % ""}<o:link name="x"/><o:joint/></robot>'
    assert load(other).mechanism.joint_names == ("j",)
    misspelt = f'<robot xmlns="urn:x" name="r">{BODY.replace("inertial", "inertail")}{TURN % ""}</robot>'
    assert "did you mean <inertial>?" in refused(misspelt).message


def test_a_macro_that_nothing_declares_is_no_foreign_word() -> None:
    """Passed over, it would be a robot without what the macro stands for."""
    assert "unbound prefix" in refused(f"<robot>{BODY}{TURN % ''}<xacro:leg/></robot>").message


def test_limits_the_wrong_way_round_are_none_with_a_warning() -> None:
    reversed_one = '<limit lower="2" upper="1" effort="7" velocity="5"/>'
    robot = load(robot_of(reversed_one))
    right = load(robot_of('<limit effort="7" velocity="5"/>'))

    assert robot.mechanism.notes == (
        "warning: joint 'j': <limit> lower 2 is above upper 1, so psdmc uses neither: exchange them",
    )
    (limits,) = [joint.limits for joint in robot.mechanism.joints]
    assert (limits.lower, limits.upper) == (-math.inf, math.inf)
    assert limits == right.mechanism.joints[0].limits
    assert load(robot_of('<limit lower="0" upper="0"/>')).mechanism.notes == ()
    for kind in ("continuous", "fixed"):
        quiet = robot_of(reversed_one, "<link name='more'/>", 'type="continuous"').replace(
            "revolute", kind, 1
        )
        assert not any("above" in note for note in load(quiet).mechanism.notes)


def robot_of(limit: str, more: str = "", kind: str = "") -> str:
    """The arm with a limit; with `kind`, a further joint of that type and its link."""
    further = f'<joint name="k" {kind}><parent link="arm"/><child link="more"/></joint>' if kind else ""
    body = f'<link name="more">{INERTIAL}</link>' if more else ""
    return f'<robot name="r">{BODY}{TURN % limit}{body}{further}</robot>'
