"""`psdmc show` on a terminal of 80 columns and into a pipe: names whole, no boxes, theta_b numbered as in the header."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from bundled import bundled_model
from command_line import status, typed
from urdf_text import joint, link, urdf

from psdmc.cli.tables import Table, lines, pieces

BOXES = re.compile("[\u2500-\u257f]")
LONG = "shoulder_pan_joint_of_the_left_arm"
LIMIT = '<limit lower="-2.8973" upper="2.8973" velocity="2.175" effort="87"/>'
LINKS = [f"link_with_a_long_name_{k}" for k in range(4)]
JOINTS = [
    joint(f"{LONG}_{k}", *LINKS[k : k + 2], xyz="0 0 0", axis=f"0 {k % 2} {1 - k % 2}", extra=LIMIT)
    for k in range(3)
]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("long")
    (folder / "arm.urdf").write_text(urdf(*map(link, LINKS), *JOINTS), encoding="utf-8")
    assert status("derive", folder / "arm.urdf", "-o", folder / "arm.npz") == 0
    return folder / "arm.npz"


def on_a_terminal(columns: int, *words: object) -> str:
    """What `psdmc WORDS` prints on a terminal of so many columns, without its colours."""
    own, its = pty.openpty()
    environment = os.environ | {"COLUMNS": str(columns), "TERM": "xterm"}
    command = [sys.executable, "-m", "psdmc", *map(str, words)]
    done = subprocess.Popen(command, stdout=its, stderr=subprocess.DEVNULL, env=environment)
    os.close(its)
    said = b""
    while True:
        try:
            piece = os.read(own, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        said += piece
    os.close(own)
    assert done.wait(timeout=100) == 0
    return re.sub(r"\033\[\d*m", "", said.decode().replace("\r\n", "\n"))


def of_tables(said: str) -> list[str]:
    """The lines of a text from its first table on, up to the one that says the largest error."""
    found = said.splitlines()
    return found[found.index("") : next(k for k, line in enumerate(found) if line.startswith("largest"))]


@pytest.mark.parametrize("columns", [80, 200])
def test_names_are_whole_on_a_terminal(model: Path, columns: int) -> None:
    said = on_a_terminal(columns, "show", model)

    for k in range(3):
        assert f"{LONG}_{k}" in said
        assert f"link_with_a_long_name_{k + 1}" in said
    assert "…" not in said
    assert max(map(len, of_tables(said))) <= columns


def test_a_pipe_gets_neither_boxes_nor_wide_lines(model: Path) -> None:
    said = typed("show", model).stdout

    assert not BOXES.search(said)
    assert "\033" not in said
    assert max(map(len, of_tables(said))) <= 80
    assert not any(line != line.rstrip() for line in said.splitlines())
    assert "-2.897 .. 2.897 rad" in said
    assert "87 N m" in said


@pytest.mark.parametrize("command", ["check", "show --cost"])
def test_other_tables_likewise(model: Path, command: str) -> None:
    word, *options = command.split()
    said = typed(word, model, *options).stdout

    assert not BOXES.search(said)
    table = [line for line in said.splitlines() if not line.startswith(("compared", "note", "pass: "))]
    assert max(map(len, table)) <= 80


def test_theta_b_is_numbered_as_in_the_header(tmp_path: Path) -> None:
    model = bundled_model("two_link")
    model.save(tmp_path / "m.npz")
    assert status("emit-c", tmp_path / "m.npz", "-o", tmp_path / "c", "--functions", "gravity") == 0
    (header,) = (tmp_path / "c" / "include").rglob("*.h")
    in_header = re.findall(r"^ \*   (\d+)  (.+)  \[(.+)\]$", header.read_text(), re.MULTILINE)

    said = typed("show", tmp_path / "m.npz").stdout
    table = said[said.index("theta_b") :]
    shown = re.findall(r"^(\d+) +(\S+) +(kg(?: m(?:\^2)?)?)  +(.+)$", table, re.MULTILINE)

    assert len(in_header) == model.l
    assert [(number, text, unit) for number, _, unit, text in shown] == in_header


def test_columns_that_do_not_fit_follow_below_with_the_keys_again() -> None:
    table = Table(("joint", "a", "b"), [("elbow", "x" * 10, "y" * 10)])

    assert [list(lines(piece, 22)) for piece in pieces(table, 22)] == [
        ["joint  a", "elbow  xxxxxxxxxx"],
        ["joint  b", "elbow  yyyyyyyyyy"],
    ]
    assert [list(piece.heads) for piece in pieces(table, 80)] == [["joint", "a", "b"]]


def test_an_equation_is_wrapped_between_its_terms() -> None:
    table = Table(
        ("k", "equation"), [("0", "Izz1 + 0.106662 m4 - 2 d4 my4 + Iyy3")], prose=True, breaks=r" (?=[-+] )"
    )

    assert list(lines(table, 27)) == [
        "k  equation",
        "0  Izz1 + 0.106662 m4",
        "   - 2 d4 my4 + Iyy3",
    ]


def test_control_characters_of_names_are_escaped() -> None:
    assert list(lines(Table(("joint", "q"), [("a\x1b[2Jb", "1")]), 80))[1] == r"a\x1b[2Jb  1"
