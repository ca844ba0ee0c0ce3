"""Check whether a command may write to its output path, before its work."""

from __future__ import annotations

import os
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
