"""Declared limits of robot files: absurd numbers, sizes and names are refused by the entry's name and the range."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from small_robots import dh, load_dh, load_urdf
from urdf_text import INERTIAL, joint, link, urdf

from psdmc.derivation.derive import derive_model
from psdmc.errors import InputError
from psdmc.robot import limits
from psdmc.robot.closed_loops import loop_tables
from psdmc.robot.load import load_robot, load_robot_text

ARM = (link("base"), link("arm"), joint("shoulder", "base", "arm"))


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def refused(call, *arguments, **options) -> str:
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert "\n" not in caught.value.message + str(caught.value.hint)
    assert caught.value.hint
    assert len(caught.value.message) < 400
    return caught.value.message


@pytest.mark.parametrize(
    ("plain", "changed", "said"),
    [
        (
            'value="1.5"',
            'value="1e300"',
            "link 'arm': <mass> value='1e300' is out of range, expected 0, or 1e-12 to",
        ),
        ('value="1.5"', 'value="1e-310"', "link 'arm': <mass> value='1e-310', expected a finite number"),
        ('value="1.5"', 'value="1e-15"', "link 'arm': <mass> value='1e-15' is out of range"),
        (
            'ixx="0.02"',
            'ixx="1e200"',
            "link 'arm': <inertia> ixx='1e200' is out of range, expected 0, or 1e-60 to",
        ),
        ('ixx="0.02"', 'ixx="-1e-160"', "link 'arm': <inertia> ixx='-1e-160' is out of range"),
        (
            'xyz="0.1 -0.05 0.2"',
            'xyz="0.1 1e155 0"',
            "link 'arm': <origin> xyz='0.1 1e155 0' is out of range",
        ),
        (
            'xyz="0.1 0.2 0.3"',
            'xyz="1e155 0 0"',
            "joint 'shoulder': <origin> xyz='1e155 0 0' is out of range",
        ),
        (
            'xyz="0.1 0.2 0.3"',
            'xyz="1e-160 0 0"',
            "joint 'shoulder': <origin> xyz='1e-160 0 0' is out of range",
        ),
        ('rpy="0 0 0"', 'rpy="0 1e155 0"', "joint 'shoulder': <origin> rpy='0 1e155 0' is out of range"),
        ('xyz="0 0 1"', 'xyz="0 0 1e155"', "joint 'shoulder': <axis> xyz='0 0 1e155' is out of range"),
        ('xyz="0 0 1"', 'xyz="0 0 1e-160"', "joint 'shoulder': length of <axis>, 1e-160, is out of range"),
        (
            'velocity="3"',
            'velocity="-3"',
            "joint 'shoulder': <limit> velocity='-3' is negative, expected no less than zero",
        ),
        (
            'effort="40"',
            'effort="-40"',
            "joint 'shoulder': <limit> effort='-40' is negative, expected no less than zero",
        ),
    ],
)
def test_absurd_numbers_of_a_urdf(plain: str, changed: str, said: str):
    text = urdf(link("base", ""), link("arm"), joint("shoulder", "base", "arm")).replace(plain, changed)

    assert refused(load_robot_text, text, "urdf", source_name="arm.urdf").startswith(f"arm.urdf: {said}")


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("a = 1e155", "joint 'j': a: 1e+155 is out of range, expected 0, or 1e-60 to 10000 m in magnitude"),
        ("d = 1e-160", "joint 'j': d: 1e-160 is out of range"),
        ("d = 5e-324", "joint 'j': d: 4.94066e-324 is out of range"),
        ("alpha = 1e9", "joint 'j': alpha: 1e+09 is out of range"),
        ('theta = "1e9 deg"', "joint 'j': theta: 1.74533e+07 is out of range"),
        ('theta = "\u0669\u0660 deg"', "joint 'j': theta: '\u0669\u0660 deg' is no angle"),
        ('theta = "9_0 deg"', "joint 'j': theta: '9_0 deg' is no angle"),
        ('theta = "nan deg"', "joint 'j': theta: 'nan deg' is no angle"),
        ("drive_inertia = 1e300", "joint 'j': drive_inertia: 1e+300 is out of range"),
        (
            "link = { mass = 1e300 }",
            "joint 'j' link: mass: 1e+300 is out of range, expected 0, or 1e-12 to 1e+06 kg",
        ),
        ("link = { com = [0, 1e155, 0] }", "joint 'j' link: com: 1e+155 is out of range"),
        ("link = { inertia_com = { xx = 1e300 } }", "joint 'j' link inertia_com: xx: 1e+300 is out of range"),
        ("limits = { speed = -1 }", "joint 'j' limits: speed: found -1, expected no less than zero"),
        (
            'limits = { speed = "-90 deg" }',
            "joint 'j' limits: speed: found -1.5708, expected no less than zero",
        ),
        ("limits = { effort = -1.5 }", "joint 'j' limits: effort: found -1.5, expected no less than zero"),
        (
            "limits = { acceleration = -2 }",
            "joint 'j' limits: acceleration: found -2, expected no less than zero",
        ),
        ("limits = { speed = nan }", "joint 'j' limits: speed: found nan, expected a finite number"),
        ("a = " + "9" * 400, "joint 'j': a: found 99999"),
        ("a = " + "9" * 5000, "not a TOML file: Exceeds the limit"),
        ("a = true", "joint 'j': a: found True, expected a finite number"),
        ("a = []", "joint 'j': a: found [], expected a finite number"),
        ('a = "1"', "joint 'j': a: found '1', expected a finite number"),
        ("a = 2020-01-01", "joint 'j': a: found datetime.date(2020, 1, 1), expected a finite number"),
        ("link = { com = {} }", "joint 'j' link: com: found {}, expected a list"),
        ("link = { com = [] }", "joint 'j' link: com: found [], expected three numbers"),
        ("link = { com = [true, 0, 0] }", "joint 'j' link: com: found True, expected a finite number"),
        ("link = { inertia_com = [1] }", "joint 'j' link inertia_com: found [1], expected a table"),
        ("link = { zero = [1] }", "joint 'j' link: zero: found 1, expected a text"),
        ('link = { zero = ["a\\nb"] }', "joint 'j' link: zero: unknown 'a\\nb' (known:"),
        ("limits = []", "joint 'j' limits: found [], expected a table"),
        ("limits = { position = [0] }", "joint 'j' limits: position: found [0], expected [lower, upper]"),
        ("limits = { position = {} }", "joint 'j' limits: position: found {}, expected a list"),
        ("type = []", "joint 'j': type: found [], expected one of revolute, prismatic"),
        ('"a\\nb" = 1', "joint 'j': unknown key 'a\\nb' (known:"),
    ],
)
def test_wrong_and_absurd_entries_of_a_dh_row(row: str, said: str):
    assert refused(load_dh, f'name = "j"\n{row}').startswith(f"arm.toml: {said}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[" * 20000, "not a TOML file: "),
        ("x = " + "[" * 20000, "not a TOML file: "),
        ("joint = 3", "joint: found 3, expected a list"),
        ("joint = []", "no [[joint]] in it"),
        ("joint = [3]", "joint 'joint1': found 3, expected a table"),
        ('name = "a\\u0000b"\n[[joint]]\nname = "j"', "robot name 'a\\x00b' has control characters"),
        ('[[joint]]\nname = "a\\u2028b"', "joint name 'a\\u2028b' has control characters"),
        ("[[joint]]\nname = []", "joint 'joint1': name: found [], expected a text"),
        ('gravity = 9.81\n[[joint]]\nname = "j"', "gravity: found 9.81, expected a list"),
        ('gravity = [0, 0, 1e300]\n[[joint]]\nname = "j"', "gravity: [0.0, 0.0, 1e+300] is out of range"),
        ('gravity = [0, 0, 1e-100]\n[[joint]]\nname = "j"', "gravity: [0.0, 0.0, 1e-100] is out of range"),
        ('convention = 1\n[[joint]]\nname = "j"', "convention: found 1, expected one of standard, modified"),
        ('name = "' + "x" * 2000 + '"\n[[joint]]\nname = "j"', "robot name 'xxx"),
    ],
)
def test_wrong_and_absurd_dh_files(text: str, said: str):
    assert said in refused(load_robot_text, text, "dh", source_name="arm.toml")


def test_loops_that_are_no_toml():
    for text in ("[" * 20000, "x = " + "[" * 20000, "a = = 1"):
        said = refused(loop_tables, Path("arm.toml"), text)
        assert said.startswith("arm.toml: not a TOML file: ")
        assert "recursion" not in said


def test_a_chain_of_too_many_rows():
    rows = [f'name = "j{k}"' for k in range(limits.MAX_JOINTS + 1)]

    assert "201 joints, psdmc reads at most 200" in refused(load_dh, *rows)
    assert len(load_dh(*rows[1:]).chain) == 200


def fixed_chain(count: int) -> str:
    """A link that turns, and that many links fixed to it, one on the other."""
    links = [link(f"l{k}", "") for k in range(count + 2)]
    joints = [
        joint(f"j{k}", f"l{k}", f"l{k + 1}", kind="fixed" if k else "revolute") for k in range(count + 1)
    ]
    return urdf(*links, *joints)


def test_ten_thousand_fixed_links_are_refused_and_not_a_crash():
    assert "10002 links, psdmc reads at most 1000" in refused(load_robot_text, fixed_chain(10_000), "urdf")


def test_the_longest_chain_of_fixed_links_is_read():
    chain = load_robot_text(fixed_chain(limits.MAX_LINKS - 2), "urdf").chain

    assert chain.tip_name == "l999"
    np.testing.assert_allclose(chain.tip.translation, np.array([0.1, 0.2, 0.3]) * 998, rtol=1e-12)


def test_too_many_movable_joints():
    count = limits.MAX_JOINTS + 1
    links = [link(f"l{k}") for k in range(count + 1)]
    joints = [joint(f"j{k}", f"l{k}", f"l{k + 1}", xyz="0 0 0.1") for k in range(count)]

    found = refused(load_urdf, *links, *joints)

    assert "201 movable joints from 'l0' to 'l201', psdmc reads at most 200" in found


@pytest.mark.parametrize("depth", [1000, 100_000])
def test_deeply_nested_elements_are_harmless(depth: int):
    nest = "<gazebo>" * depth + "</gazebo>" * depth

    assert load_urdf(*ARM, nest).chain.joint_names == ("shoulder",)


def test_a_file_that_is_too_large(tmp_path):
    (tmp_path / "large.urdf").write_text(urdf(*ARM) + " " * limits.MAX_BYTES, encoding="utf-8")

    assert "more than 4 MiB" in refused(load_robot, tmp_path / "large.urdf")
    assert "more than 4 MiB" in refused(load_robot_text, " " * (limits.MAX_BYTES + 1), "urdf")


@pytest.mark.parametrize("kind", ["elements", "attributes", "links"])
def test_files_with_thousands_of_faults_have_short_messages(kind: str):
    if kind == "elements":
        parts = (*ARM, *(f"<gear{k}/>" for k in range(limits.MAX_UNKNOWN)))
        assert load_urdf(*parts).chain.notes[-1] == "88 more kinds of elements are not read"
        parts = (link("base"), link("arm", INERTIAL.replace("</in", "<a/>" * 30_000 + "</in")), ARM[2])
    elif kind == "attributes":
        words = " ".join(f'a{k}="1"' for k in range(30_000))
        parts = (link("base"), link("arm", INERTIAL.replace("<mass ", f"<mass {words} ")), ARM[2])
    else:
        parts = tuple(link(f"l{k}", INERTIAL.replace("1.5", "x")) for k in range(900))
    with pytest.raises(InputError) as caught:
        load_urdf(*parts)

    assert "and " in caught.value.message
    assert " more" in caught.value.message
    assert len(caught.value.message) < 4000


def test_thousands_of_unknown_elements_are_refused():
    found = refused(load_urdf, *ARM, *(f"<gear{k}/>" for k in range(30_000)))

    assert found == "arm.urdf: 30000 different unknown elements, psdmc reads at most 100"


def test_more_joints_than_links():
    found = refused(load_urdf, *ARM, *(joint(f"j{k}", "base", "arm") for k in range(2000)))

    assert found == "arm.urdf: 2001 joints, psdmc reads at most 1000"


@pytest.mark.parametrize("length", ["1e-7", "1e-60"])
def test_robots_of_no_size_are_refused(length: str):
    bodies = INERTIAL.replace("0.1 -0.05 0.2", f"{length} 0 0")
    parts = (link("base", ""), link("arm", bodies), joint("j", "base", "arm", xyz=f"0 0 {length}"))

    assert f"the longest of all its lengths, {float(length):g} m, is out of range" in refused(
        load_urdf, *parts
    )
    assert f"the longest of all its lengths, {float(length):g} m" in refused(
        load_dh, f'name = "j"\na = {length}'
    )


def test_remains_of_rounding_do_no_harm():
    noisy = (
        link("base"),
        link("arm"),
        joint("shoulder", "base", "arm", xyz="0.1 -3.7e-33 1.2e-17", rpy="6e-17 0 4e-33"),
    )
    clean = (link("base"), link("arm"), joint("shoulder", "base", "arm", xyz="0.1 0 0"))

    found, expected = load_urdf(*noisy).chain.joints[0], load_urdf(*clean).chain.joints[0]

    assert found.placement.translation.tolist() == expected.placement.translation.tolist()
    assert found.placement.rotation.tolist() == expected.placement.rotation.tolist()


@pytest.mark.parametrize("length", ["1e4", "1e-6"])
@pytest.mark.parametrize("mass", ["1e-12", "1e6"])
def test_robots_at_the_limits_come_out_right(length: str, mass: str):
    """Their certificates are those of any robot."""
    size = float(mass) * float(length) ** 2
    rows = [
        f'name = "j{k}"\na = {length}\nalpha = {k}.0\n'
        f"link = {{ mass = {mass}, com = [{length}, 0.0, 0.0], inertia_com = "
        f"{{ xx = {size}, xy = 0.0, yy = {size}, xz = 0.0, yz = 0.0, zz = {size} }} }}"
        for k in range(2)
    ]
    model = derive_model(load_robot_text(dh(*rows), "dh").chain)

    assert model.certificate.max() < 1e-13


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("gravity", (0, 0, 1e300), "gravity [0.0, 0.0, 1e+300] is out of range"),
        ("gravity", "down", "gravity 'down' is not three finite numbers"),
        ("gravity", (0, 0, "x"), "gravity [0, 0, 'x'] is not three finite numbers"),
        ("gravity", 9.81, "gravity 9.81 is not three finite numbers"),
        ("drive_inertia", (1e300,), "drive inertia 1e+300 is out of range"),
        ("drive_inertia", (float("nan"),), "drive inertias [nan] are not all finite and positive"),
        ("snap", "x", "snap is 'x' rad, expected 0 to 0.1"),
        ("base", 3, "base is 3, expected a link's name"),
        ("assume_zero", "arm:mx", "assume-zero is 'arm:mx', expected texts"),
        ("assume_zero", (3,), "assume-zero is (3,), expected texts"),
    ],
)
def test_options_out_of_range(option: str, value: object, said: str):
    assert refused(load_urdf, *ARM, **{option: value}).startswith(said)


def test_a_chain_the_wrong_way_round_says_so():
    with pytest.raises(InputError) as caught:
        load_urdf(*ARM, base="arm", tip="base")

    assert caught.value.message == "arm.urdf: tip link 'base' is not below base link 'arm' but above it"
    assert caught.value.hint == "a chain runs from its base to its tip: swap them, --base 'base' --tip 'arm'"


def test_a_tip_on_another_branch_hints_at_what_is_below():
    parts = (*ARM, link("lamp"), joint("mount", "base", "lamp"))
    with pytest.raises(InputError) as caught:
        load_urdf(*parts, base="arm", tip="lamp")

    assert caught.value.message == "arm.urdf: tip link 'lamp' is not below base link 'arm'"
    assert caught.value.hint == "no link is below 'arm': choose another --base"


def test_every_limit_is_in_the_documents():
    text = (
        (Path(__file__).parents[2] / "docs" / "robot_files.md").read_text(encoding="utf-8").replace(",", "")
    )
    table = text[text.index("## Numbers and limits") :]
    for number in (limits.MAX_LINKS, limits.MAX_JOINTS, limits.MAX_CHARACTERS, limits.MAX_NAME):
        assert f"| {number}" in table
    ranges = (
        limits.LENGTH,
        limits.MASS,
        limits.INERTIA,
        limits.DRIVE_INERTIA,
        limits.AXIS_LENGTH,
        limits.GRAVITY_LENGTH,
    )
    for each in ranges:
        least, most = (
            f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")
            for value in (each.least, each.most)
        )
        assert f"{least} to {most}" in table, each
