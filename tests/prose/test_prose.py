"""The project's prose keeps the house style, and the check finds planted faults of each rule."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import house_style
import linter
import pytest
from house_style import Fault, Piece
from prose import MOST, breaks, check, listed, main, owed
from sources import ROOT, docstrings, document_paths, everything, markdown, messages

LONG = (
    "psdmc reads a robot file and "
    + ", ".join(f"{'abcdefghijk'[k]}-links are read then" for k in range(8))
    + " as well"
)
"""A sentence of 40 words, without its full stop."""


def test_the_prose_keeps_the_house_style():
    result = check(everything(), listed())

    broken = breaks(result.faults, owed())
    assert not broken, "\n".join(["", *broken])
    assert not result.unneeded, "these exceptions can go: " + "\n".join(result.unneeded)
    assert not result.too_many(), f"{result.exceptions}, at most {MOST}"


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        ("sentence", LONG + "."),
        ("paragraph", " ".join(f"Robot {name} has a file of links and joints." for name in "ABCDEFGHIJKL")),
        ("cell", f"| a |\n|---|\n| {' '.join(LONG.split()[:26])} |"),
        ("banned word", "Each torque is held against Pinocchio's."),
        ("banned word", "The length is said in metres."),
        ("banned word", "Another way needs fewer sums."),
        ("banned word", "Half a turn later the arm stops."),
        ("banned word", "A robot on a free root falls."),
        ("banned word", "The sum is skipped, where the factor is zero."),
        ("banned word", "# What comes out"),
        ("hash", "The figures are those of 9ca5758."),
        ("machines", "A call takes 47 ns on Zen 5 and 60 ns on Zen 4."),
        ("machines", "A call takes 47 ns on an EPYC 9755 and 60 ns on an EPYC 9354."),
        ("linter", "The the robot falls."),
    ],
)
def test_a_planted_fault_is_found(rule: str, text: str):
    assert rules_of(text) == {rule}


@pytest.mark.parametrize(
    "text",
    [
        "psdmc reads a robot file and writes its dynamics as C.",
        "`held against`, `way` and `9ca5758-x` are code, and [a link](where/it/stands.md) may have any target.",
        "A call takes 47 ns on an EPYC 9755 (Zen 5).",
        "```console\n$ psdmc says so many words of its own, and mends them\n```\n",
        "The folder where the model is has 1234567 files.",
        "| where the feet are |\n|---|",
        "psdmc writes C for Cortex-M4F, Cortex-M7 and 64-bit ARM.",
    ],
)
def test_what_is_no_fault(text: str):
    assert rules_of(text) == set()


def test_a_long_sentence_in_readme_is_found(tmp_path: Path):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    before = faults_of(readme)
    after = faults_of(f"{readme}\n{LONG}.\n")

    assert [fault.rule for fault in after if fault.name not in {old.name for old in before}] == ["sentence"]
    assert after[-1].line == readme.count("\n") + 2


def test_faults_have_the_line_that_they_begin_at():
    text = f"# Page\n\n```c\nint x;\n\n```\n\nShort.\n\n- An item.\n- {LONG}.\n"

    assert [fault.line for fault in faults_of(text)] == [11]


def test_an_exception_covers_one_text_and_leaves_with_it():
    page = list(markdown(LONG + ".", "page.md"))
    name = f"page.md | sentence | {LONG[:60].strip()}"

    assert check(page, [name]).faults == ()
    assert check(page, [name]).unneeded == ()
    assert check([], [name]).unneeded == (name,)


def test_exceptions_are_few():
    sentences = [f"page.md | sentence | {k}" for k in range(MOST["sentence"] + 1)]

    assert check([], sentences[:-1]).too_many() == []
    assert check([], sentences).too_many() == ["sentence"]
    assert check([], ["page.md | banned word | way"]).too_many() == ["banned word"]


def test_what_is_owed_only_falls():
    faults = check(list(markdown(LONG + ".", "page.md")), []).faults

    assert breaks(faults, {"page.md": 1}) == []
    assert breaks(faults, {}) == [str(faults[0])]
    assert breaks((), {"page.md": 1}) == ["page.md 0: lower its number in owed.txt"]


def test_the_check_covers_what_users_read():
    names = {str(path.relative_to(ROOT)) for path in document_paths()}
    public = {piece.file for piece in docstrings()}

    assert {
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "examples/README.md",
        "docs/functions.md",
    } <= names
    assert not any("decisions" in name for name in names)
    assert {
        "psdmc/compiler.py",
        "psdmc/model/dynamics_model.py",
        "psdmc/toolchain/compiled_functions.py",
    } <= public


def test_messages_are_covered(tmp_path: Path):
    shown = tmp_path / "psdmc" / "shown.py"
    shown.parent.mkdir()
    shown.write_text('raise InputError(f"{file}: is held against the model", "no hint")\n', encoding="utf-8")
    pieces = list(messages(tmp_path))

    assert pieces == [Piece("psdmc/shown.py", 1, "message", "`x`: is held against the model")]
    assert [fault.rule for fault in house_style.faults(pieces)] == ["banned word"]


def test_many_messages_are_found():
    files = {piece.file for piece in messages()}

    assert {
        "psdmc/cli/pipeline.py",
        "psdmc/robot/urdf/dependent_joints.py",
        "psdmc/toolchain/build_package.py",
    } <= files


def test_the_command_fails_on_a_planted_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    for path in (*document_paths(), *sorted((ROOT / "psdmc").rglob("*.py*"))):
        to = tmp_path / path.relative_to(ROOT)
        to.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix != ".pyc":
            shutil.copy(path, to)
    (tmp_path / "README.md").write_text(f"# psdmc\n\n{LONG}.\n", encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["prose.py", str(tmp_path)])

    assert main() == 1
    assert "README.md:3: sentence: 40 words, at most 30: psdmc reads a robot" in capsys.readouterr().out


def faults_of(text: str) -> list[Fault]:
    pieces = list(markdown(text, "page.md"))
    return [*house_style.faults(pieces), *linter.faults(pieces)]


def rules_of(text: str) -> set[str]:
    return {fault.rule for fault in faults_of(text)}
