"""The compile cache's folder and size limit. It is not shared with other users.

Libraries in it run inside the caller's process. Only folders and files that belong to this user or to root, and that no
other user may write, are used.
"""

from __future__ import annotations

import os
import re
import stat
import sys
from pathlib import Path

from psdmc.errors import InputError, ToolchainError

VARIABLE = "PSDMC_CACHE_DIR"
SIZE_VARIABLE = "PSDMC_CACHE_SIZE"
DEFAULT_SIZE = "1G"
"""Some 500 six-joint arms with all functions."""

_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_directory() -> Path:
    """PSDMC_CACHE_DIR, else the platform's place for caches, as an absolute path; ToolchainError where neither is
    known."""
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return Path(os.path.abspath(chosen))
    if sys.platform == "darwin":
        return _home() / "Library" / "Caches" / "psdmc"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or _home()) / "psdmc" / "cache"
    below = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (below if below.is_absolute() else _home() / ".cache") / "psdmc"


def _home() -> Path:
    try:
        home = Path() if os.environ.get("HOME") == "" else Path.home()
    except RuntimeError:
        home = Path()
    if not home.is_absolute():
        raise ToolchainError("no home folder for the compile cache: HOME is not set", _choose())
    return home


def cache_limit() -> int:
    """Bytes that PSDMC_CACHE_SIZE allows: a number, or one with K, M, G or T; InputError where it is neither."""
    text = os.environ.get(SIZE_VARIABLE) or DEFAULT_SIZE
    found = re.fullmatch(r"([0-9]{1,12})([KMGT]?)", text.strip().upper())
    if found is None:
        raise InputError(f"{SIZE_VARIABLE} is {text!r}", "give bytes, or a number with K, M, G or T: 500M")
    return int(found[1]) * _UNITS[found[2]]


def open_cache() -> Path:
    """The cache's folder, made where it is missing; ToolchainError where it cannot be made or other users could write
    into it."""
    place = cache_directory()
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.mkdir(mode=0o700, exist_ok=True)
        check_place(place)
    except OSError as error:
        raise unusable(place, error) from error
    return place


def check_place(place: Path) -> None:
    """ToolchainError where other users own the cache's folder, may write it, or may replace it."""
    resolved = Path(os.path.realpath(place))
    status = resolved.stat()
    if not is_private(status):
        owner = "" if _is_ours(status) else f" belongs to user {status.st_uid} and"
        hint = f"{_choose()}, or: chmod go-w {place}" if _is_ours(status) else _choose()
        what = "could hold libraries of theirs" if owner else "may be written by other users"
        raise ToolchainError(f"{place}: not used as compile cache: it{owner} {what}", hint)
    for folder in resolved.parents:
        mode = folder.stat().st_mode
        if os.name == "posix" and mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise ToolchainError(
                f"{place}: not used as compile cache: everybody may rename folders in {folder}", _choose()
            )


def is_private(status: os.stat_result) -> bool:
    """Whether a file or folder belongs to this user or root, and no other user may write it."""
    return os.name != "posix" or (_is_ours(status) and not status.st_mode & _OTHERS_MAY_WRITE)


def _is_ours(status: os.stat_result) -> bool:
    return sys.platform == "win32" or status.st_uid in (0, os.geteuid())


def unusable(place: Path, error: OSError) -> ToolchainError:
    """The error for a cache folder that cannot be written to."""
    return ToolchainError(f"{place}: cannot write to the compile cache: {error.strerror or error}", _choose())


def _choose() -> str:
    return f"set {VARIABLE} to a folder of yours"
