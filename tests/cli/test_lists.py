"""Lists on the command line: commas, several words, and an option that is given again."""

from __future__ import annotations

from pathlib import Path

import pytest
from bundled import robot_path
from command_line import status
from urdf_text import BALL, joint, link, urdf

from psdmc.cli.arguments import assignments, names, with_numbers_joined
from psdmc.model.load import load

TREE = urdf(
    link("base", ""),
    *(link(name, BALL) for name in "abc"),
    joint("one", "base", "a", kind="continuous"),
    joint("two,too", "a", "b", kind="continuous", axis="0 1 0"),
    joint("three", "b", "c", kind="continuous", axis="0 1 0"),
    name="t",
)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "t.urdf").write_text(TREE, encoding="utf-8")
    return tmp_path / "t.urdf"


GRAVITY = [
    ("--gravity", "1", "0", "-9.5"),
    ("--gravity", "1,0,-9.5"),
    ("--gravity=1,0,-9.5",),
    ("--gravity", "1,", "0,", "-9.5"),
    ("--gravity", "1", "--gravity", "0,-9.5"),
]


@pytest.mark.parametrize("words", GRAVITY, ids=" ".join)
def test_gravity_is_taken_in_every_way(words: tuple[str, ...], tmp_path: Path) -> None:
    assert status("derive", robot_path("scara"), "-o", tmp_path / "m.npz", *words) == 0
    assert load(tmp_path / "m.npz").mechanism.gravity.tolist() == [1.0, 0.0, -9.5]


def test_negative_numbers_first(tmp_path: Path) -> None:
    assert status("derive", robot_path("scara"), "-o", tmp_path / "m.npz", "--gravity", "-1,0,-9.5") == 0
    assert load(tmp_path / "m.npz").mechanism.gravity.tolist() == [-1.0, 0.0, -9.5]


@pytest.mark.parametrize("words", [("1,2",), ("1,2,x",), ("1", "2", "3", "--gravity", "4"), ("",)])
def test_another_count_or_no_number_is_refused(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status("derive", robot_path("scara"), "-o", tmp_path / "m.npz", "--gravity", *words) == 2
    said = capsys.readouterr().err
    assert "gravity" in said
    assert "--gravity 0" in said
    assert not (tmp_path / "m.npz").exists()


def test_a_tool_in_six_words_or_one(tree: Path) -> None:
    found = []
    for words in (("0.1", "0", "-0.2", "0", "0", "1"), ("0.1,0,-0.2,0,0,1",)):
        assert status("derive", tree, "-o", tree.with_suffix(".npz"), "--tool", *words) == 0
        found.append(load(tree.with_suffix(".npz")).content_hash)
    assert found[0] == found[1]


def test_lists_of_names_add_up(tree: Path, tmp_path: Path) -> None:
    frames = ("--frames", "b", "--frames", "c, a")
    assert status("derive", tree, "-o", tmp_path / "m.npz", *frames) == 0
    assert [frame.name for frame in load(tmp_path / "m.npz").mechanism.frames] == ["b", "c", "a"]

    functions = ("--functions", "gravity", "--functions", "jacobian,mass_matrix")
    assert status("emit-c", tmp_path / "m.npz", "-o", tmp_path / "c", *functions) == 0
    sources = {path.stem for path in (tmp_path / "c" / "src").glob("*.c")}
    assert {"gravity", "jacobian", "mass_matrix"} == sources - {"tables"}


@pytest.mark.parametrize("words", [("one=0.5,two,too=0",), ("one=0.5", "--lock", "two,too=0")])
def test_locks_are_separated_by_commas_though_names_may_have_some(
    words: tuple[str, ...], tree: Path, tmp_path: Path
) -> None:
    assert status("derive", tree, "-o", tmp_path / "m.npz", "--lock", *words) == 0
    assert load(tmp_path / "m.npz").joint_names == ("three",)


def test_drive_inertias_add_up(tree: Path, tmp_path: Path) -> None:
    words = ("--drive-inertia", "0.1,0.2", "--drive-inertia", "0.3")
    assert status("derive", tree, "-o", tmp_path / "m.npz", *words) == 0
    assert load(tmp_path / "m.npz").mechanism.parameters[:, 10].tolist() == [0.1, 0.2, 0.3]


def test_words() -> None:
    assert names(["a, b", "c"]) == ("a", "b", "c")
    assert names(None) == ()
    assert assignments(["a=1,b,c=2", "d=3"]) == ("a=1", "b,c=2", "d=3")
    assert assignments(["a=1,b"]) == ("a=1", "b")
    assert with_numbers_joined(["derive", "r", "--gravity", "0", "0", "-9", "7", "-o", "m"]) == [
        *("derive", "r", "--gravity", "0,0,-9", "7", "-o", "m")
    ]
