"""Limits the compile cache: leftovers of killed builds go first, then what was not used for longest."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import secrets
import shutil
import stat
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psdmc.errors import InputError, ToolchainError
from psdmc.files import lock

IN_USE = 600.0
"""Seconds after its last use during which an entry is kept whatever the limit: a process may be about to open it."""

_KEY = re.compile(r"[0-9a-z]{64}")
_PASSING = re.compile(r"\.(build|gone|turn)-[0-9a-z]{16}|\.[0-9a-z]{16}-[0-9a-z_]{8}")
"""Folders of builds under way and of entries being removed, files that say whose turn it is to
build; the last form is that of psdmc 0.1."""


@dataclass(frozen=True, slots=True)
class CacheContents:
    """The folder of the compile cache, its number of entries and bytes, and its size limit in bytes."""

    place: Path
    entries: int
    size: int
    limit: int


def cache_contents() -> CacheContents:
    """Return the present contents of the compile cache. Raises ToolchainError if other users may write its folder."""
    place = cache_directory()
    entries = _entries(place)
    return CacheContents(place, len(entries), sum(size for _, size, _ in entries), cache_limit())


def clear_cache() -> int:
    """Remove all entries and the leftovers of killed builds; return the number of entries removed."""
    place = cache_directory()
    entries = _entries(place)
    with hold(place):
        for _, _, entry in entries:
            remove(entry)
    sweep(place)
    return len(entries)


def make_room(place: Path, keep: Path, limit: int) -> None:
    """Remove the least recently used entries, but not `keep`, until the cache has at most `limit` bytes."""
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
    """Remove the build folders, in the compile cache, of processes that have ended."""
    with contextlib.suppress(OSError):
        for name in sorted(os.listdir(place)):
            if _PASSING.fullmatch(name):
                _remove_if_dead(place / name)


def new_folder(place: Path) -> tuple[int, Path]:
    """Return a new empty build folder, and a handle whose lock marks it as used by this process."""
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
    """Within the block, lock the cache folder against other processes, where the file system has locks."""
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
    """Remove a cache entry. The entry is first renamed, so that no other process finds an incomplete entry. An entry
    that another process has just removed is ignored."""
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


def _remove_if_dead(folder: Path) -> None:
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        try:
            if lock(handle, wait=False):
                if folder.is_dir() and not folder.is_symlink():
                    shutil.rmtree(folder, ignore_errors=True)
                else:
                    folder.unlink(missing_ok=True)
        finally:
            os.close(handle)


# Entries: a folder each, with the digests of its files, used only while they agree.
SEAL = "entry.json"
"""Lists an entry's files with their SHA-256; its time is that of the entry's last use."""

_PLAIN = re.compile(r"[\w-][\w.-]*")
"""A file's name without a folder: most are."""

LARGEST_SEAL = 1 << 20
"""Bytes; a six-joint arm's has 6 kB."""


def seal(folder: Path) -> None:
    """Write a list of all files of a cache entry with their digests. Make the entry writable for this user only."""
    files: dict[str, str] = {}
    size = 0
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            continue
        path.chmod(path.stat().st_mode & ~0o022)
        if path.is_file():
            files[str(path.relative_to(folder))] = _digest(path)
            size += path.stat().st_size
    text = json.dumps({"files": files, "bytes": size}, indent=1) + "\n"
    (folder / SEAL).write_text(text, encoding="utf-8")
    (folder / SEAL).chmod(0o600)


def is_sound(folder: Path) -> bool:
    """Return whether a cache entry is complete, unaltered and writable by this user alone, and thus safe to load."""
    try:
        if not _is_own(folder, stat.S_ISDIR):
            return False
        files = _seal_of(folder)[0]["files"]
        return bool(files) and all(
            _is_own(folder / name, stat.S_ISREG) and _digest(folder / name) == value
            for name, value in files.items()
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False


def touch(folder: Path) -> None:
    """Record that a cache entry was used now. The function does nothing if the cache cannot be written."""
    with contextlib.suppress(OSError):
        os.utime(folder / SEAL)


def used_and_size(folder: Path) -> tuple[float, int]:
    """Return when a cache entry was last used (s since 1970), and the entry's size in bytes. For an incomplete entry,
    return the time when it was made."""
    try:
        content, used = _seal_of(folder)
        return used, int(content["bytes"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        sizes = (Path(top, name).lstat().st_size for top, _, names in os.walk(folder) for name in names)
        return folder.lstat().st_mtime, sum(sizes)


def _is_own(path: Path, kind: object) -> bool:
    """Whether the path is a file or folder of that kind, no link, that no other user may write."""
    status = path.lstat()
    return bool(kind(status.st_mode)) and is_private(status)  # type: ignore[operator]


def _seal_of(folder: Path) -> tuple[dict[str, Any], float]:
    """A seal's content, and when the entry was last used. A cache has thousands, all read at each build: paths are texts."""
    path = os.path.join(folder, SEAL)
    status = os.lstat(path)
    if not stat.S_ISREG(status.st_mode) or not is_private(status) or status.st_size > LARGEST_SEAL:
        raise ValueError(f"{path} is no seal")
    with open(path, "rb", buffering=0) as stream:
        content = json.loads(stream.read())
    if any(map(_is_elsewhere, content["files"])):
        raise ValueError(f"{path} names files elsewhere")
    return dict(content), status.st_mtime


def _is_elsewhere(name: str) -> bool:
    """Whether a name leads out of the folder."""
    if _PLAIN.fullmatch(name):
        return False
    path = Path(name)
    return path.is_absolute() or ".." in path.parts


def _digest(path: Path) -> str:
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


# Libraries in it run inside the caller's process. Only folders and files that belong to this user or to root, and that no
# other user may write, are used.
VARIABLE = "PSDMC_CACHE_DIR"
SIZE_VARIABLE = "PSDMC_CACHE_SIZE"
_CHOOSE = f"set {VARIABLE} to a folder of yours"
DEFAULT_SIZE = "1G"
"""Some 500 six-joint arms with all functions."""

_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_directory() -> Path:
    """Return the absolute path of the cache folder: PSDMC_CACHE_DIR, else the platform's folder for caches. Raises
    ToolchainError if neither is known."""
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
        raise ToolchainError("no home folder for the compile cache: HOME is not set", _CHOOSE)
    return home


def cache_limit() -> int:
    """Return the size limit in bytes from PSDMC_CACHE_SIZE, such as 2G. Raises InputError for other text."""
    text = os.environ.get(SIZE_VARIABLE) or DEFAULT_SIZE
    found = re.fullmatch(r"([0-9]{1,12})([KMGT]?)", text.strip().upper())
    if found is None:
        raise InputError(f"{SIZE_VARIABLE} is {text!r}", "give bytes, or a number with K, M, G or T: 500M")
    return int(found[1]) * _UNITS[found[2]]


def open_cache() -> Path:
    """Return the cache folder, and make the folder if it is missing. Raises ToolchainError if the folder cannot be
    made, or if other users could write into it."""
    place = cache_directory()
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.mkdir(mode=0o700, exist_ok=True)
        check_place(place)
    except OSError as error:
        raise unusable(place, error) from error
    return place


def check_place(place: Path) -> None:
    """Raise ToolchainError if other users own the cache folder, may write it, or may replace it."""
    resolved = Path(os.path.realpath(place))
    status = resolved.stat()
    if not is_private(status):
        owner = "" if _is_ours(status) else f" belongs to user {status.st_uid} and"
        hint = f"{_CHOOSE}, or: chmod go-w {place}" if _is_ours(status) else _CHOOSE
        what = "could hold libraries of theirs" if owner else "may be written by other users"
        raise ToolchainError(f"{place}: not used as compile cache: it{owner} {what}", hint)
    for folder in resolved.parents:
        mode = folder.stat().st_mode
        if os.name == "posix" and mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise ToolchainError(
                f"{place}: not used as compile cache: everybody may rename folders in {folder}", _CHOOSE
            )


def is_private(status: os.stat_result) -> bool:
    """Return whether a file or folder belongs to this user or root, and no other user may write it."""
    return os.name != "posix" or (_is_ours(status) and not status.st_mode & _OTHERS_MAY_WRITE)


def _is_ours(status: os.stat_result) -> bool:
    return sys.platform == "win32" or status.st_uid in (0, os.geteuid())


def unusable(place: Path, error: OSError) -> ToolchainError:
    """Return the exception to raise for a cache folder that cannot be written."""
    return ToolchainError(f"{place}: cannot write to the compile cache: {error.strerror or error}", _CHOOSE)
