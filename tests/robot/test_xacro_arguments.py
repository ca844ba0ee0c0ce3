"""xacro files with arguments and ROS packages, without a ROS installation."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import pytest
from command_line import typed

import psdmc
from psdmc.errors import InputError
from psdmc.robot.load import LoadedRobot, load_robot

pytest.importorskip("xacro")

ARM = """
<?xml version="1.0"?>
<robot name="$(arg name)" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="name" default="none"/><xacro:arg name="joints" default="2"/>
<xacro:include filename="$(find my_description)/urdf/part.xacro"/>
<xacro:macro name="arm" params="number parent">
<link name="arm${number}"><inertial><origin xyz="${length/2} 0 0"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j${number}" type="continuous"><parent link="${parent}"/><child link="arm${number}"/>
<origin xyz="${length} 0 0"/><axis xyz="0 1 0"/></joint>
</xacro:macro>
<link name="base"/><xacro:arm number="1" parent="base"/>
<xacro:if value="${$(arg joints) > 1}"><xacro:arm number="2" parent="arm1"/></xacro:if>
</robot>
"""
PART = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="length" value="{}"/></robot>"""


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A robot's file whose package is nowhere near it."""
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    (tmp_path / "robots").mkdir()
    file = tmp_path / "robots" / "arm.urdf.xacro"
    # "name" is asked for before its declaration, as ROS's own files do: it is always given here.
    file.write_text(ARM, encoding="utf-8")
    return file


def package(folder: Path, length: float = 0.4, name: str = "my_description", manifest: bool = True) -> Path:
    (folder / "urdf").mkdir(parents=True)
    (folder / "urdf" / "part.xacro").write_text(PART.format(length), encoding="utf-8")
    if manifest:
        (folder / "package.xml").write_text(f"<package><name> {name} </name></package>", encoding="utf-8")
    return folder


def loaded(file: Path, **options: Any) -> LoadedRobot:
    return load_robot(file, xacro_args={"name": "ur5e", **options.pop("args", {})}, **options)


def length_of(robot: LoadedRobot) -> float:
    return float(robot.mechanism.joints[-1].placement.translation[0])


def test_arguments_reach_the_file(arm: Path, tmp_path: Path) -> None:
    folders = {"my_description": package(tmp_path / "anywhere")}

    two, one = loaded(arm, packages=folders), loaded(arm, args={"joints": 1}, packages=folders)

    assert (two.mechanism.name, two.mechanism.joint_names) == ("ur5e", ("j1", "j2"))
    assert one.mechanism.joint_names == ("j1",)
    assert one.options.as_json()["xacro_args"] == {"name": "ur5e", "joints": "1"}


def test_a_package_is_found_where_ros_has_it(arm: Path, tmp_path: Path, monkeypatch: Any) -> None:
    """Of several the given one first, then ROS 2's, ROS 1's, and what lies about the robot's file."""
    package(tmp_path / "my_description", 0.1)
    assert length_of(loaded(arm)) == 0.1

    package(tmp_path / "ws" / "src" / "stack" / "description", 0.2)
    (tmp_path / "ws" / "src" / "old").mkdir()
    (tmp_path / "ws" / "src" / "old" / "CATKIN_IGNORE").touch()
    package(tmp_path / "ws" / "src" / "old" / "copy", 0.9)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'nowhere'}:{tmp_path / 'ws' / 'src'}")
    assert length_of(loaded(arm)) == 0.2

    prefix = tmp_path / "opt"
    package(prefix / "share" / "my_description", 0.3, manifest=False)
    index = prefix / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(prefix))
    assert length_of(loaded(arm)) == 0.2, "neither in the index nor with a manifest"
    (index / "my_description").touch()
    assert length_of(loaded(arm)) == 0.3

    given = package(tmp_path / "given", 0.5)
    assert length_of(loaded(arm, packages={"my_description": str(given)})) == 0.5


def test_a_package_beside_and_above_the_file_is_found(tmp_path: Path, monkeypatch: Any) -> None:
    """As in a clone of a repository of several packages."""
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    own = package(tmp_path / "clone" / "arm_description", name="other")
    package(tmp_path / "clone" / "my_description", 0.7)
    (own / "urdf" / "arm.xacro").write_text(ARM, encoding="utf-8")
    assert length_of(loaded(own / "urdf" / "arm.xacro")) == 0.7


def refused(call: Any) -> InputError:
    with pytest.raises(InputError) as error:
        call()
    assert "\n" not in error.value.message
    return error.value


def test_a_package_that_is_not_found_is_named_with_the_remedy(arm: Path) -> None:
    error = refused(lambda: loaded(arm))
    assert error.message == "arm.urdf.xacro: package 'my_description' is not found"
    assert error.hint == "--package my_description=DIR, or set ROS_PACKAGE_PATH or AMENT_PREFIX_PATH"


@pytest.mark.parametrize("name", ["..", "/etc", "a/../..", ".git"])
def test_a_name_that_leads_elsewhere_is_no_package(arm: Path, name: str) -> None:
    arm.write_text(ARM.replace("find my_description", f"find {name}"), encoding="utf-8")
    assert refused(lambda: loaded(arm)).message == f"arm.urdf.xacro: package '{name}' is not found"


def test_wrong_arguments_are_refused(arm: Path, tmp_path: Path) -> None:
    folders = {"my_description": package(tmp_path / "anywhere")}
    error = refused(lambda: loaded(arm, args={"jiont": 1}, packages=folders))
    assert error.message == "arm.urdf.xacro: it has no xacro argument 'jiont'"
    assert error.hint == "it has: 'name', 'joints'"
    assert "expected texts or numbers" in refused(lambda: load_robot(arm, xacro_args={"a": None})).message
    assert "is no folder" in refused(lambda: load_robot(arm, packages={"a": tmp_path / "none"})).message
    missing = refused(lambda: load_robot(arm, packages=folders))
    assert missing.message == "arm.urdf.xacro: xacro cannot expand it: Undefined substitution argument name"
    assert missing.hint == "give it behind the file: NAME:=VALUE"
    (tmp_path / "plain.urdf").write_text("<robot name='x'><link name='a'/></robot>", encoding="utf-8")
    error = refused(lambda: load_robot(tmp_path / "plain.urdf", xacro_args={"a": "b"}))
    assert error.message == "plain.urdf: no xacro file, and 'a' is given as an argument of one"


def test_what_it_includes_is_not_longer_than_a_robots_file(arm: Path, tmp_path: Path) -> None:
    folder = package(tmp_path / "anywhere")
    (folder / "urdf" / "part.xacro").unlink()
    (folder / "urdf" / "part.xacro").symlink_to("/dev/zero")
    error = refused(lambda: loaded(arm, packages={"my_description": folder}))
    assert "more than 4 MiB, which is the most that psdmc reads" in error.message


def test_the_commands_take_them(arm: Path, tmp_path: Path, monkeypatch: Any) -> None:
    given = ("--package", f"my_description={package(tmp_path / 'anywhere')}")
    there = tmp_path / "robots"

    shown = typed("show", arm.name, "name:=ur5e", *given, cwd=there)
    assert shown.returncode == 0, shown.stderr
    assert shown.stderr.endswith(f"next: psdmc derive arm.urdf.xacro name:=ur5e {' '.join(given)}\n")
    words = ("name:=ur5e", "--xacro-arg", "joints:=1", "-o", "m.npz")
    derived = typed("derive", arm.name, *given, *words, cwd=there)
    assert derived.returncode == 0, derived.stderr
    assert psdmc.load(there / "m.npz").n == 1

    arm.rename(there / "moved.xacro")
    assert typed("check", "m.npz", cwd=there).returncode == 0
    again = ("check", "m.npz", "--robot", "moved.xacro")
    assert typed(*again, *given, cwd=there).returncode == 0, "with the model's own arguments"
    other = typed(*again, *given, "joints:=2", cwd=there)
    assert (other.returncode, other.stderr.splitlines()[0]) == (
        2,
        "error: moved.xacro has joints j1, j2, the model has j1",
    )
    for words, said in {
        ("derive", "moved.xacro", "other.urdf"): "xacro argument 'other.urdf' is not of the form NAME:=VALUE",
        ("derive", "moved.xacro", "a:=1", "--xacro-arg", "a:=2"): "xacro argument 'a' is given twice",
        ("derive", "moved.xacro", "--package", "x"): "--package: 'x' is no NAME=DIR",
        ("show", "m.npz", "a:=1"): "m.npz: a model, which has no further arguments",
        ("check", "m.npz", "a:=1"): "xacro arguments or packages are given, but no xacro file",
    }.items():
        done = typed(*words, cwd=there)
        assert (done.returncode, done.stderr.splitlines()[0]) == (2, f"error: {said}")


def test_a_models_own_expression_is_not_evaluated(arm: Path, tmp_path: Path) -> None:
    """A model's file may be forged: what xacro would evaluate must come from the user."""
    given = {"my_description": package(tmp_path / "anywhere")}
    model = psdmc.derive(arm, xacro_args={"name": "x", "joints": "(1)"}, packages=given)
    model.save(tmp_path / "m.npz")
    again = ("check", "m.npz", "--robot", arm, "--package", f"my_description={tmp_path / 'anywhere'}")

    done = typed(*again, cwd=tmp_path)
    said = "error: the model's value of xacro argument 'joints' is more than a word or numbers"
    assert (done.returncode, done.stderr.splitlines()[0]) == (2, said)
    assert typed(*again, "joints:=(1)", cwd=tmp_path).returncode == 0


def test_a_value_reaches_no_shell(arm: Path, tmp_path: Path) -> None:
    folders = {"my_description": package(tmp_path / "anywhere")}
    name = f"; touch {tmp_path}/x; `touch {tmp_path}/y`"
    assert load_robot(arm, xacro_args={"name": name}, packages=folders).mechanism.name == name
    assert not (tmp_path / "x").exists()
    assert not (tmp_path / "y").exists()


def test_from_a_pipe_the_remedy_is_said(tmp_path: Path) -> None:
    """A xacro file or an MJCF is read again, with all that it includes, which a pipe does not give."""
    os.mkfifo(tmp_path / "pipe")
    threading.Thread(target=(tmp_path / "pipe").write_text, args=(ARM,)).start()
    error = refused(lambda: load_robot(tmp_path / "pipe", xacro_args={"name": "x"}))
    assert error.message == (
        "cannot read an MJCF or xacro file from a pipe: it is read again with all that it includes"
    )
    assert "psdmc derive <(xacro FILE)" in str(error.hint)
