"""The compile cache's contents, and how its size is limited: leftovers of killed builds and the oldest entries are
removed."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from psdmc.atomic import lock
from psdmc.toolchain.cache_entry import used_and_size
from psdmc.toolchain.cache_place import cache_directory, cache_limit, check_place, unusable

IN_USE = 600.0
"""Seconds after its last use during which an entry is kept whatever the limit: a process may be about to open it."""

_KEY = re.compile(r"[0-9a-z]{64}")
_PASSING = re.compile(r"\.(build|gone|turn)-[0-9a-z]{16}|\.[0-9a-z]{16}-[0-9a-z_]{8}")
"""Folders of builds under way and of entries being removed, files that say whose turn it is to
build; the last form is that of psdmc 0.1."""


@dataclass(frozen=True, slots=True)
class CacheContents:
    """The cache's folder, its number of entries and bytes, and how many bytes it may have."""

    place: Path
    entries: int
    size: int
    limit: int


def cache_contents() -> CacheContents:
    """The present contents; ToolchainError where other users may write the folder."""
    place = cache_directory()
    entries = _entries(place)
    return CacheContents(place, len(entries), sum(size for _, size, _ in entries), cache_limit())


def clear_cache() -> int:
    """Remove every entry and what killed builds left, nothing else; returns the number of entries removed."""
    place = cache_directory()
    entries = _entries(place)
    with hold(place):
        for _, _, entry in entries:
            remove(entry)
    sweep(place)
    return len(entries)


def make_room(place: Path, keep: Path, limit: int) -> None:
    """Remove the least recently used entries beyond `limit` bytes, except `keep` and those just used."""
    entries = _entries(place)
    total = sum(size for _, size, _ in entries)
    old = time.time() - IN_USE
    with hold(place):
        for used, size, entry in sorted(entries):
            if total <= limit or used > old:
                return
            if entry != keep:
                remove(entry)
                total -= size


def sweep(place: Path) -> None:
    """Remove the folders of processes that have ended."""
    with contextlib.suppress(OSError):
        for name in sorted(os.listdir(place)):
            if _PASSING.fullmatch(name):
                _remove_if_dead(place / name)


def new_folder(place: Path) -> tuple[int, Path]:
    """An empty folder to build in, locked by the handle while this process lives."""
    while True:
        own = place / f".build-{secrets.token_hex(8)}"
        own.mkdir(mode=0o700)
        # Another process may remove it as a leftover before it is locked.
        with contextlib.suppress(FileNotFoundError):
            handle = _opened(own)
            lock(handle)
            if own.is_dir():
                return handle, own
            os.close(handle)


@contextlib.contextmanager
def hold(place: Path) -> Iterator[None]:
    """Lock the cache while entries are moved, where the file system can lock."""
    handle = _opened(place)
    try:
        lock(handle)
        yield
    finally:
        os.close(handle)


def _opened(folder: Path) -> int:
    """A handle to lock a folder by. Windows cannot open folders, and there is no lock there."""
    return os.open(os.devnull if sys.platform == "win32" else folder, os.O_RDONLY)


def remove(entry: Path) -> None:
    """Rename the entry in one step, so that no process finds half of it, then delete it. One that another process has
    removed since it was listed is gone already."""
    gone = entry.parent / f".gone-{secrets.token_hex(8)}"
    try:
        entry.rename(gone)
    except FileNotFoundError:
        return
    if gone.is_symlink() or not gone.is_dir():
        gone.unlink()
    shutil.rmtree(gone, ignore_errors=True)


def _entries(place: Path) -> list[tuple[float, int, Path]]:
    """Time of last use, bytes, and folder of each entry."""
    try:
        if not place.is_dir():
            return []
        check_place(place)
        found = [place / name for name in sorted(os.listdir(place)) if _KEY.fullmatch(name)]
    except OSError as error:
        raise unusable(place, error) from error
    known = []
    for entry in found:
        with contextlib.suppress(OSError):  # another process removed it
            known.append((*used_and_size(entry), entry))
    return known


def _removed(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _remove_if_dead(folder: Path) -> None:
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        try:
            if lock(handle, wait=False):
                _removed(folder)
        finally:
            os.close(handle)
