"""Check whether a command may write to its output path, before its work; and name the next command after it."""

from __future__ import annotations

import contextlib
import os
import shlex
import sys
from pathlib import Path

from psdmc.atomic import check_place
from psdmc.errors import InputError


def check_output(output: Path | None, *inputs: Path) -> None:
    """Raise InputError if psdmc cannot write a file at this path, or if the path is one of the inputs."""
    if output is None:
        return
    for source in inputs:
        if _is_same(output, source):
            raise InputError(
                f"{output}: would overwrite {source}, which is read", "give another name for the output"
            )
    check_place(output)


def check_report(report: Path | None, *others: Path) -> None:
    """Raise InputError if a report or its JSON file cannot be written. The folder of the report may be missing."""
    if report is None:
        return
    if not report.name:
        raise InputError(f"--report is {str(report)!r}, a folder", "call the page FILE.html")
    numbers = report.with_suffix(".json")
    if _is_same(report, numbers):
        raise InputError(
            f"{report}: psdmc writes the report's numbers to this file", "call the page FILE.html"
        )
    for path in (report, numbers):
        if path.parent.exists():
            check_output(path, *others)


def _is_same(one: Path, other: Path) -> bool:
    try:
        return os.path.samefile(one, other)
    except OSError:
        return os.path.abspath(one) == os.path.abspath(other)


def say_next(*words: object) -> None:
    """Print `next: psdmc WORDS`, quoted for a shell, to standard error, because standard output has only results."""
    say_next_line(shlex.join(["psdmc", *map(str, words)]))


def quoted(word: object) -> str:
    """A word as a shell takes it."""
    return shlex.quote(str(word))


def say_next_line(line: str) -> None:
    """Print `next: LINE` to standard error, after the results. Print nothing if the results cannot be written."""
    sys.stdout.flush()
    with contextlib.suppress(OSError):  # whoever closed it does not want to know
        if sys.stderr is not None:
            print(f"next: {one_line(line)}", file=sys.stderr)


def one_line(text: str) -> str:
    """Return untrusted text without control characters, which are escaped, so that it fits on one line of a terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
