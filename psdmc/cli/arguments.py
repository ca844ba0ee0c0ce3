"""Reads and checks values of the command line: options that take a list, and paths to which a command writes.

A list's entries are separated by commas, or the option is given several times; numbers may also be several words.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from psdmc.errors import InputError
from psdmc.files import check_place

SEVERAL_WORDS: Mapping[str, int] = {"--gravity": 3, "--tool": 6}
"""Options of as many numbers, which may stand side by side: `--gravity 0 0 -9.81`."""


def names(given: Sequence[str] | None) -> tuple[str, ...]:
    """Return the names in all values of an option, in order."""
    return tuple(name for value in given or () for word in value.split(",") if (name := word.strip()))


def numbers(given: Sequence[str] | None, option: str, hint: str) -> tuple[float, ...] | None:
    """Return the numbers in all values of an option; None if it is not given. Raise InputError for other words."""
    if not given:
        return None
    text = ",".join(given)
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise InputError(f"{option} is {text!r}", hint) from None


def assignments(given: Sequence[str] | None) -> tuple[str, ...]:
    """Return the texts NAME=VALUE in all values of an option, in order. A comma separates two texts only if the next
    word has a "=", as names in robot files may contain commas."""
    found: list[str] = []
    for value in given or ():
        pending: list[str] = []
        for word in value.split(","):
            pending.append(word)
            if "=" in word:
                found.append(",".join(pending).strip())
                pending = []
        if pending:
            found.append(",".join(pending).strip())
    return tuple(word for word in found if word)


def with_numbers_joined(words: Sequence[str]) -> list[str]:
    """Return the command line with the numbers after some options joined by commas.

    For example, `--gravity 0 0 -9.81` becomes `--gravity 0,0,-9.81`.
    """
    joined: list[str] = []
    rest = list(words)
    while rest:
        word = rest.pop(0)
        joined.append(word)
        most = SEVERAL_WORDS.get(word, 0)
        taken: list[str] = []
        while rest and sum(map(_count, taken)) < most and _is_numeric(rest[0]):
            taken.append(rest.pop(0))
        if taken:
            joined.append(",".join(part.strip(",") for part in taken))
    return joined


def _count(word: str) -> int:
    return len(word.strip(",").split(","))


def _is_numeric(word: str) -> bool:
    try:
        [float(part) for part in word.strip(",").split(",")]
    except ValueError:
        return False
    return True


def parsed_torque_constants(given: list[str] | None) -> dict[str, float] | None:
    """Return the torque constants by joint from 'joint=36.1,...'; None if nothing is given."""
    found: dict[str, float] = {}
    for word in assignments(given):
        name, _, value = word.rpartition("=")
        try:
            constant = float(value)
        except ValueError:
            raise InputError(f"--torque-constants: {word!r}", "write JOINT=NUMBER,JOINT=NUMBER") from None
        name = name.strip()
        if not name or name in found:
            what = f"joint {name!r} twice" if name else f"{word!r} names no joint"
            raise InputError(f"--torque-constants: {what}", "write JOINT=NUMBER,JOINT=NUMBER")
        found[name] = constant
    return found or None


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
