"""What the compile cache holds, and how it is kept small: old entries go first, and what killed builds left."""

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
"""s after its last use during which an entry stays whatever the limit: a process may be about to open it."""

_KEY = re.compile(r"[0-9a-z]{64}")
_PASSING = re.compile(r"\.(build|gone)-[0-9a-f]{16}|\.[0-9a-z]{16}-[0-9a-z_]{8}")
"""Folders of builds under way and of entries being removed; the last form is that of psdmc 0.1."""


@dataclass(frozen=True, slots=True)
class CacheContents:
    """The cache at a glance: its folder, how many entries and bytes it has, and how many bytes it may have."""

    place: Path
    entries: int
    size: int
    limit: int


def cache_contents() -> CacheContents:
    """What is there now; ToolchainError where the place is not to be trusted."""
    place = cache_directory()
    entries = _entries(place)
    return CacheContents(place, len(entries), sum(size for _, size, _ in entries), cache_limit())


def clear_cache() -> int:
    """Remove every entry and what killed builds left, nothing else; returns how many entries went."""
    place = cache_directory()
    entries = _entries(place)
    with hold(place):
        for _, _, entry in entries:
            remove(entry)
    sweep(place)
    return len(entries)


def make_room(place: Path, keep: Path, limit: int) -> None:
    """Remove the least recently used entries beyond `limit` bytes, but for `keep` and those just used."""
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
    """Remove the folders of processes that are gone."""
    with contextlib.suppress(OSError):
        for name in sorted(os.listdir(place)):
            if _PASSING.fullmatch(name):
                _remove_if_dead(place / name)


def new_folder(place: Path) -> tuple[int, Path]:
    """An empty folder to build in, locked by the handle while this process lives."""
    while True:
        own = place / f".build-{secrets.token_hex(8)}"
        own.mkdir(mode=0o700)
        with contextlib.suppress(FileNotFoundError):  # taken for a dead one before it was locked
            handle = _opened(own)
            lock(handle)
            if own.is_dir():
                return handle, own
            os.close(handle)


@contextlib.contextmanager
def hold(place: Path) -> Iterator[None]:
    """Alone at moving entries, where the file system can lock."""
    handle = _opened(place)
    try:
        lock(handle)
        yield
    finally:
        os.close(handle)


def _opened(folder: Path) -> int:
    """A handle to lock a folder by; Windows opens none, and locks none."""
    return os.open(os.devnull if sys.platform == "win32" else folder, os.O_RDONLY)


def remove(entry: Path) -> None:
    """Out of the way in one step, so that nobody finds half an entry; then away."""
    gone = entry.parent / f".gone-{secrets.token_hex(8)}"
    entry.rename(gone)
    if gone.is_symlink() or not gone.is_dir():
        gone.unlink()
    shutil.rmtree(gone, ignore_errors=True)


def _entries(place: Path) -> list[tuple[float, int, Path]]:
    """When last used, bytes, and folder of each entry."""
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


def _remove_if_dead(folder: Path) -> None:
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        try:
            if lock(handle, wait=False):
                shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(handle)
