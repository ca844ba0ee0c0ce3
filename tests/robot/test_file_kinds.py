"""Robot files that are neither URDF nor DH table: xacro is expanded where xacro is installed, SDF is told."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from psdmc.errors import InputError
from psdmc.robot.load import load_robot
from psdmc.robot.xml_text import root_tag

XACRO = """<?xml version="1.0"?>
<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:property name="length" value="0.4"/>
<xacro:macro name="arm" params="number parent">
<link name="arm${number}"><inertial><origin xyz="${length/2} 0 0"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j${number}" type="continuous"><parent link="${parent}"/><child link="arm${number}"/>
<origin xyz="${length} 0 0"/><axis xyz="0 0 1"/></joint>
</xacro:macro>
<link name="base"/><xacro:arm number="1" parent="base"/><xacro:arm number="2" parent="arm1"/>
</robot>"""


@pytest.mark.parametrize("name", ["arm.xacro", "arm.urdf.xacro", "arm.urdf", "arm.xml"])
def test_xacro_is_expanded_whatever_the_file_is_called(name: str, tmp_path: Path) -> None:
    pytest.importorskip("xacro")
    (tmp_path / name).write_text(XACRO, encoding="utf-8")

    robot = load_robot(tmp_path / name)

    assert robot.mechanism.joint_names == ("j1", "j2")
    assert robot.mechanism.joints[1].placement.translation.tolist() == [0.4, 0.0, 0.0]
    assert robot.mechanism.parameters[:, :2].tolist() == [[2.0, 0.4], [2.0, 0.4]]
    assert "xacro:" not in robot.source_text


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("${length/2}", "${lenght/2}"),
        ("<xacro:arm number", "<xacro:leg number"),
        ("</robot>", ""),
        ("${length/2}", "${1/0}"),
    ],
)
def test_what_xacro_refuses_is_said_in_a_line(
    old: str, new: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("xacro")
    (tmp_path / "arm.xacro").write_text(XACRO.replace(old, new), encoding="utf-8")

    with pytest.raises(InputError, match=r"arm\.xacro: xacro cannot expand it: ") as refused:
        load_robot(tmp_path / "arm.xacro")

    assert "\n" not in refused.value.message
    assert capfd.readouterr().err == ""


def test_without_xacro_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "arm.xacro").write_text(XACRO, encoding="utf-8")

    with pytest.raises(InputError, match="a xacro file, and xacro is not installed") as refused:
        load_robot(tmp_path / "arm.xacro")
    assert "pip install 'psdmc[xacro]'" in str(refused.value.hint)


@pytest.mark.parametrize("name", ["arm.sdf", "arm.xml"])
def test_an_sdf_is_told(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(
        '<?xml version="1.0"?>\n<!-- x -->\n<sdf version="1.9"><model name="a"/></sdf>', "utf-8"
    )

    with pytest.raises(InputError, match="an SDF, which psdmc does not read") as refused:
        load_robot(tmp_path / name)
    assert "URDF, xacro or MJCF" in str(refused.value.hint)


@pytest.mark.parametrize(
    ("text", "tag"),
    [
        ("<robot/>", "robot"),
        ('\ufeff<?xml version="1.0"?>\n<!-- <mujoco> -->\n<sdf>', "sdf"),
        ("  <mujoco model='x'>", "mujoco"),
        ("", ""),
        ("no XML", ""),
        ("<!--" * 20_000, ""),
    ],
)
def test_the_first_element(text: str, tag: str) -> None:
    assert root_tag(text) == tag


def test_what_xacro_has_expanded_is_a_urdf(tmp_path: Path) -> None:
    """xacro leaves its namespace in what it writes, as in most URDFs of ROS packages: it is not asked again."""
    text = TWO_LINKS.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', 1)
    (tmp_path / "expanded.urdf").write_text(text, encoding="utf-8")
    assert load_robot(tmp_path / "expanded.urdf").mechanism.joint_names == ("turn",)


def test_a_macro_in_a_comment_asks_for_no_xacro(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in example-robot-data's quadruped."""
    monkeypatch.setitem(sys.modules, "xacro", None)
    text = TWO_LINKS.replace('<link name="arm">', '<!-- <xacro:leg prefix="FL"/> --><link name="arm">', 1)
    (tmp_path / "expanded.urdf").write_text(text, encoding="utf-8")
    assert load_robot(tmp_path / "expanded.urdf").mechanism.joint_names == ("turn",)


TWO_LINKS = """
<robot name="x">
  <link name="base"/>
  <link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
</robot>
"""
