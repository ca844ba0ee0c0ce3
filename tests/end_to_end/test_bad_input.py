"""Whatever a user gets wrong: one line that names what and where, a hint, a status, no traceback, no half-written file."""

from __future__ import annotations

import io
import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from bundled import robot_path
from command_line import files_in, status, typed
from urdf_text import inertial, joint, link, urdf

BASE, ARM, SHOULDER = link("base"), link("arm"), joint("shoulder", "base", "arm")
BOMB = '<!DOCTYPE r [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"/>'
EXTERNAL = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot name="arm">&x;</robot>'
MIMIC = joint("finger", "arm", "tip", extra='<mimic joint="finger"/>')

ROBOTS = {
    "empty": ("", "the file is empty"),
    "not XML": ("solid arm", "not well-formed XML"),
    "an entity bomb": (BOMB, "entities"),
    "an external entity": (EXTERNAL, "entities"),
    "a link that is not there": (urdf(BASE, joint("shoulder", "base", "arm")), "'arm'"),
    "a loop": (urdf(BASE, ARM, SHOULDER, joint("second", "base", "arm")), "'arm'"),
    "no movable joint": (urdf(BASE, ARM, joint("mount", "base", "arm", kind="fixed")), "no movable joint"),
    "a zero axis": (urdf(BASE, ARM, joint("shoulder", "base", "arm", axis="0 0 0")), "'shoulder'"),
    "a mass that is no number": (urdf(BASE, link("arm", inertial("nan")), SHOULDER), "'arm'"),
    "a negative mass": (urdf(BASE, link("arm", inertial("-1")), SHOULDER), "'arm'"),
    "a joint that mimics itself": (urdf(BASE, ARM, link("tip"), SHOULDER, MIMIC), "'finger'"),
    "a spherical joint": (urdf(BASE, ARM, joint("loose", "base", "arm", kind="spherical")), "'loose'"),
}


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """refused(words...): the error line of a command that must fail cleanly, leaving every file as it was."""

    def call(*words: object) -> str:
        before = files_in(tmp_path)
        code = status(*words)
        said = capsys.readouterr()
        assert code not in (0, 1, 70), said.err
        assert said.out == ""
        call.hint = said.err.splitlines()[-1]
        return checked(said.err, before, files_in(tmp_path))

    return call


def checked(said: str, before: dict[str, bytes], after: dict[str, bytes]) -> str:
    assert "Traceback" not in said
    lines = said.splitlines()
    assert len(lines) == 2, said
    assert lines[0].startswith("error: ")
    assert lines[1].startswith("hint: ")
    assert after == before
    return lines[0]


@pytest.mark.parametrize("case", ROBOTS)
def test_a_robot_file(case: str, tmp_path: Path, refused):
    text, named = ROBOTS[case]
    (tmp_path / "arm.urdf").write_text(text, encoding="utf-8")

    line = refused("derive", tmp_path / "arm.urdf", "-o", tmp_path / "arm.npz")

    assert "arm.urdf" in line
    assert named in line


def test_a_missing_file(tmp_path: Path, refused):
    assert "no.urdf: no such file" in refused("derive", tmp_path / "no.urdf")


@pytest.mark.parametrize("option", ["--base", "--tip"])
def test_an_unknown_link(option: str, tmp_path: Path, refused):
    (tmp_path / "arm.urdf").write_text(urdf(BASE, ARM, SHOULDER), encoding="utf-8")

    line = refused("derive", tmp_path / "arm.urdf", option, "elbow", "-o", tmp_path / "m.npz")

    assert "'elbow'" in line


@pytest.mark.parametrize(
    ("option", "value", "named"),
    [
        ("--drive-inertia", "1,2", "2 drive inertias for 4 joints"),
        ("--drive-inertia", "1,x", "--drive-inertia"),
        ("--assume-zero", "link9:mx", "link9"),
        ("--snap", "3", "snap"),
    ],
)
def test_an_option_of_derive(option: str, value: str, named: str, tmp_path: Path, refused):
    assert named in refused("derive", robot_path("scara"), option, value, "-o", tmp_path / "m.npz")


def test_more_joints_than_can_be_expanded(tmp_path: Path, refused):
    links = [link(f"link{i}") for i in range(15)]
    joints = [joint(f"joint{i}", f"link{i}", f"link{i + 1}", axis="0.3 0.5 0.7") for i in range(14)]
    (tmp_path / "long.urdf").write_text(urdf(*links, *joints), encoding="utf-8")

    line = refused("derive", tmp_path / "long.urdf", "-o", tmp_path / "long.npz")

    assert re.search(r"14-joint .* grid of [\d,]+ points", line)
    assert "--no-expand" in refused.hint


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "scara.npz"
    assert status("derive", robot_path("scara"), "-o", path) == 0
    return path


def test_a_damaged_model(model: Path, refused, capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()
    model.write_bytes(model.read_bytes()[:-200])

    assert "scara.npz: damaged model file" in refused("show", model)


@pytest.mark.parametrize("command", [("show",), ("check",), ("emit-c", "-o", "out")])
def test_a_foreign_model(command: tuple[str, ...], tmp_path: Path, refused):
    file = io.BytesIO()
    np.savez(file, x=np.zeros(3))
    (tmp_path / "other.npz").write_bytes(file.getvalue())
    (tmp_path / "text.npz").write_text("hello")

    for name in ("other.npz", "text.npz"):
        assert f"{name}: not a psdmc model file" in refused(command[0], tmp_path / name, *command[1:])


def test_a_newer_model(model: Path, refused, capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()
    with np.load(model) as file:
        arrays = dict(file)
    manifest = json.loads(str(arrays["manifest"])) | {"schema": 99}
    np.savez(model, **arrays | {"manifest": np.array(json.dumps(manifest))})

    line = refused("show", model)

    assert "scara.npz" in line
    assert "99" in line


@pytest.mark.parametrize("command", [("derive", "-o"), ("emit-c", "-o")])
def test_a_folder_that_cannot_be_written(command, model: Path, tmp_path: Path, refused, capsys):
    capsys.readouterr()
    (tmp_path / "file").write_text("no folder")
    source = robot_path("scara") if command[0] == "derive" else model

    line = refused(command[0], source, command[1], tmp_path / "file" / "x.npz")

    assert "file" in line


def test_a_folder_with_somebody_elses_files(model: Path, tmp_path: Path, refused, capsys):
    capsys.readouterr()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "Makefile").write_text("all:\n")

    assert "mine" in refused("emit-c", model, "-o", tmp_path / "mine")


@pytest.mark.parametrize(
    ("option", "value"),
    [("--functions", "jerk"), ("--lowering", "fast"), ("--real", "half"), ("--trig", "cordic")],
)
def test_an_option_of_emit_c(option: str, value: str, model: Path, tmp_path: Path, refused, capsys):
    capsys.readouterr()

    assert f"'{value}'" in refused("emit-c", model, "-o", tmp_path / "out", option, value)


def test_a_missing_compiler(model: Path, tmp_path: Path):
    assert status("emit-c", model, "-o", tmp_path / "c", "--functions", "gravity") == 0
    before = files_in(tmp_path)

    for environment in ({"CC": "no-such-compiler"}, {"CC": "", "PATH": os.devnull}):
        done = typed("build", tmp_path / "c", **environment)
        line = checked(done.stderr, before, files_in(tmp_path))
        assert done.returncode == 4
        assert "ompiler" in line


def test_a_folder_without_a_package(tmp_path: Path, refused):
    assert "no emitted package" in refused("build", tmp_path)


def test_a_check_against_another_robot(model: Path, refused, capsys: pytest.CaptureFixture[str]):
    capsys.readouterr()

    assert "joints" in refused("check", model, "--robot", robot_path("two_link"))


def test_a_traceback_only_with_debug(tmp_path: Path):
    quiet = typed("derive", "no.urdf", cwd=tmp_path)
    loud = typed("--debug", "derive", "no.urdf", cwd=tmp_path)

    assert "Traceback" not in quiet.stderr
    assert "Traceback" in loud.stderr
    assert loud.returncode != 0
