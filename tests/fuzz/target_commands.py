"""Command lines, in process, in a folder of small files that is made anew for each."""

from __future__ import annotations

import contextlib
import io
import os
import shutil
from pathlib import Path

from mutate_argv import words_of
from outcome import BrokenRule, innermost, refusal

from psdmc.cli import main
from psdmc.errors import InputError, PsdmcError
from psdmc.model.calibrated import NOT_USABLE_STATUS

USAGE = 2
STATUSES = (0, 2, 3, 4, 5, NOT_USABLE_STATUS)
"""Success, the three classes of refusal (2 for usage too), a check that found a difference, and a calibration that is not
usable."""


def command(data: bytes, folder: Path, deep: bool) -> None:
    words = words_of(data)
    if words is None or not _stays_inside(words):
        return
    place = folder / "place"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(folder / "seed" / "files", place)
    before = Path.cwd()
    os.chdir(place)
    try:
        _typed(words)
    finally:
        os.chdir(before)


def _stays_inside(words: list[str]) -> bool:
    """Whether no word leads out of the folder, and none asks for a build, which takes compilers, or a long search."""
    outside = any(
        "/" in word and (word.startswith(("/", "~")) or "=/" in word or ".." in word) for word in words
    )
    slow = "build" in words or any(
        word.partition("=")[0] in ("--seconds", "--workers", "--rounds") and "=" in word for word in words
    )
    return not outside and not slow and not any(word.startswith("-o/") for word in words)


def _typed(words: list[str]) -> None:
    """How it ends: a status of the list; a refusal says one line and a hint; nothing else is raised."""
    said, told = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
            main(list(words))
    except SystemExit as left:
        _ended(left, told.getvalue())
    except PsdmcError:
        if "--debug" not in words:
            raise
    else:
        raise BrokenRule("NoStatus", "psdmc/cli/boundary.py:main", "main returned")


def _ended(left: SystemExit, told: str) -> None:
    status, cause = left.code or 0, left.__context__
    if status not in STATUSES:
        where = innermost(cause) if cause is not None else "psdmc/cli/boundary.py:main"
        kind = type(cause).__name__ if cause is not None else f"Status{status}"
        raise BrokenRule(kind, where, told.strip() or str(cause))
    if isinstance(cause, PsdmcError):
        found = refusal(cause)
        if found.is_find:
            raise BrokenRule(found.kind, found.where, found.said)
        if len(told.splitlines()) != 2:
            raise BrokenRule("NotTwoLines", innermost(cause), told)
        raise cause
    if status == USAGE:
        raise InputError("usage: " + " ".join(told.split()), "typer says it in lines of its own")
