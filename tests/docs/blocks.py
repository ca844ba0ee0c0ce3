"""Code blocks of the documents: found, run, and their output compared with what the document shows."""

from __future__ import annotations

import doctest
import os
import re
import subprocess
import sys
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from command_line import typed

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^```(\w+)[ ]?([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.IGNORE_EXCEPTION_DETAIL
SECONDS = 300
OF_THE_SHELL = re.compile(r"[^\w./,:=+ -]")


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block: its language, what else stands behind the fence, and the line it begins on."""

    language: str
    info: str
    text: str
    line: int


def documents() -> list[Path]:
    return sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


def blocks(document: Path) -> Iterator[Block]:
    text = document.read_text(encoding="utf-8")
    for match in FENCE.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        yield Block(match[1], match[2], match[3], line)


def run(document: Path, folder: Path) -> int:
    """Run a document's blocks in order in `folder`, where `examples` is at hand, one Python session for all."""
    (folder / "examples").symlink_to(ROOT / "examples")
    session: dict[str, object] = {"__name__": "__document__"}
    ran = 0
    for block in blocks(document):
        where = f"{document.name}:{block.line}"
        if block.info.startswith("file="):
            (folder / block.info.removeprefix("file=")).write_text(block.text, encoding="utf-8")
        elif block.language == "pycon":
            _run_python(block, where, session)
        elif block.language == "console":
            _run_console(block, where, folder)
        else:
            continue
        ran += 1
    return ran


def _run_python(block: Block, where: str, session: dict[str, object]) -> None:
    test = doctest.DocTestParser().get_doctest(block.text, session, where, where, block.line)
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=OPTIONS, verbose=False)
    with mock.patch.object(
        traceback, "format_exception_only", _without_notes(traceback.format_exception_only)
    ):
        runner.run(test, out=said.append, clear_globs=False)
    session.update(test.globs)
    assert not said, "".join(said)


def _without_notes(formatted: Callable[..., list[str]]) -> Callable[..., list[str]]:
    """What doctest compares of an exception: Python 3.11.2's takes an exception's last note for its message."""

    def lines(*exception: Any) -> list[str]:
        notes = vars(exception[-1]).pop("__notes__", None)
        try:
            return formatted(*exception)
        finally:
            if notes is not None:
                exception[-1].__notes__ = notes

    return lines


def _run_console(block: Block, where: str, folder: Path) -> None:
    for command, expected in commands(block.text):
        done = _done(command, folder)
        assert done.returncode == 0, f"{where}: {command}\n{done.stderr}"
        fits = doctest.OutputChecker().check_output(expected, done.stdout, OPTIONS)
        assert fits, f"{where}: {command}\nexpected:\n{expected}\nfound:\n{done.stdout}"


def _done(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command of psdmc alone is a fork of this process; all others, and what a shell reads in it, are the shell's."""
    program, *words = command.split(" ")
    if program == "psdmc" and not OF_THE_SHELL.search(command):
        return typed(*filter(None, words), cwd=folder)
    return subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=os.environ | {"PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])},
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )


def commands(text: str) -> Iterator[tuple[str, str]]:
    """Each command behind '$ ' and the output shown below it."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, output = part.partition("\n")
        yield command, output
