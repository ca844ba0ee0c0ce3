"""Each command says what it wrote, and ends with the next command to type, which works when it is typed."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import pytest
from bundled import bundled_model, robot_path
from command_line import typed
from unoptimised import wrapper


def next_words(stderr: str) -> list[str]:
    """The words of the line `next: ...`, which is the last."""
    last = stderr.splitlines()[-1]
    assert last.startswith("next: "), stderr
    return shlex.split(last.removeprefix("next: "))


def test_from_a_robot_file_to_a_library_by_typing_what_is_said(tmp_path: Path) -> None:
    robot = tmp_path / "my scara.toml"
    robot.write_bytes(robot_path("scara").read_bytes())
    words, typed_words, compiler = ["psdmc", "show", "my scara.toml"], [], str(wrapper(tmp_path))
    while words[0] == "psdmc":
        typed_words.append(words[1])
        done = typed(*words[1:], cwd=tmp_path, CC=compiler)
        assert done.returncode == 0, done.stderr
        words = next_words(done.stderr)

    assert typed_words == ["show", "derive", "check", "emit-c", "build"]
    assert words[:2] in (["cmake", "--install"], ["make", "-C"])
    (library,) = [line for line in done.stdout.splitlines() if line.endswith(".a: written")]
    assert (tmp_path / library.removesuffix(": written")).is_file()


def test_where_parameters_are_unknown_a_campaign_is_next(tmp_path: Path) -> None:
    replace(bundled_model("two_link"), theta_b=None).save(tmp_path / "unknown.npz")

    done = typed("show", "unknown.npz", cwd=tmp_path)

    assert next_words(done.stderr) == ["psdmc", "excite", "unknown.npz", "-o", "unknown_campaign"]


def test_what_casadi_does_not_get_is_said(tmp_path: Path) -> None:
    pytest.importorskip("casadi")
    replace(bundled_model("two_link"), theta_b=None).save(tmp_path / "unknown.npz")
    words = ("--functions", "gravity,regressor", "--with", "casadi")

    done = typed("emit-c", "unknown.npz", *words, cwd=tmp_path)

    assert done.returncode == 0
    assert "argument: gravity_theta; write --with casadi_theta to call them in CasADi\n" in done.stdout


def test_a_xacro_files_model_is_called_as_its_robot(tmp_path: Path) -> None:
    pytest.importorskip("xacro")
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    text = f"""<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/><link name="arm">{body}</link>
    <joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""
    (tmp_path / "arm.urdf.xacro").write_text(text, encoding="utf-8")

    done = typed("derive", "arm.urdf.xacro", cwd=tmp_path)

    assert next_words(done.stderr) == ["psdmc", "check", "arm.npz"]


def test_nothing_is_suggested_after_a_failure(tmp_path: Path) -> None:
    done = typed("show", tmp_path / "missing.npz")

    assert done.returncode == 2
    assert "next:" not in done.stderr


@pytest.mark.parametrize("words", [("cache",)])
def test_the_cache_says_how_to_clear_it(words: tuple[str, ...], tmp_path: Path) -> None:
    done = typed(*words, PSDMC_CACHE_DIR=str(tmp_path))

    assert done.returncode == 0
    assert "next:" not in done.stderr, "an empty cache need not be cleared"
