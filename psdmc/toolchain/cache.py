"""The compile cache, which keeps compiled libraries by their content, so that each one is compiled only once.

The key of an entry covers everything that the binary depends on: sources, flags, compiler, CPU features, psdmc's
version and the platform. psdmc uses an entry only if its files have the recorded digests, and builds it again
otherwise. If another process builds the same entry, psdmc waits for it. On file systems without locks, two processes
may build the same entry, each in its own folder; the later one then uses the entry of the earlier one.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from psdmc.errors import ToolchainError
from psdmc.files import can_lock, lock, unlock
from psdmc.toolchain.cache_room import (
    cache_limit,
    hold,
    is_sound,
    make_room,
    new_folder,
    open_cache,
    remove,
    seal,
    sweep,
    touch,
    unusable,
)


def cache_key(files: Mapping[str, str], parts: Sequence[str]) -> str:
    """Return the key of a cache entry: a hex digest of all on which the library depends."""
    platform = (sys.platform, sysconfig.get_platform(), str(sysconfig.get_config_var("SOABI")))
    digest = hashlib.sha256()
    for part in (*platform, *parts, *(item for path in sorted(files) for item in (path, files[path]))):
        data = part.encode("utf-8")
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def cached(key: str, build: Callable[[Path], None], products: Sequence[str] = ()) -> Path:
    """Return the folder of the cache entry for this key. If there is no complete, unaltered entry, the function `build`
    first fills a new folder.

    products  files that `build` must have made

    Raises ToolchainError if the cache cannot be written, if other users may write it, or if a product is missing.
    """
    place = open_cache()
    final = place / key
    if is_sound(final):
        touch(final)
        return final
    limit = cache_limit()
    try:
        sweep(place)
        with turn(place, key):
            if is_sound(final):  # made by another process meanwhile
                touch(final)
                return final
            handle, own = new_folder(place)
            try:
                build(own)
                for product in products:
                    if not (own / product).is_file() or not (own / product).stat().st_size:
                        raise ToolchainError(
                            f"the compiler made no {product}", "set CC to a C compiler, or unset it"
                        )
                seal(own)
                _install(own, final)
            finally:
                shutil.rmtree(own, ignore_errors=True)
                os.close(handle)
        make_room(place, final, limit)
    except OSError as error:
        raise unusable(place, error) from error
    return final


def found(key: str) -> Path | None:
    """Return the folder of the entry for a key; None without a complete, unaltered one. Errors: see `cached`."""
    final = open_cache() / key
    if not re.fullmatch(r"[0-9a-f]{64}", key) or not is_sound(final):
        return None
    touch(final)
    return final


def _install(own: Path, final: Path) -> None:
    """Move a folder into place, over a damaged or foreign one; a sound entry of another process stays."""
    with hold(final.parent):
        if is_sound(final):
            return
        if os.path.lexists(final):
            remove(final)
        own.rename(final)


# One builder at a time for each entry: others wait for it and use what it made.
LONGEST = 600.0
"""Seconds that one waits for another process: as long as a run of the compiler may take. Then one builds beside it."""
BETWEEN = 0.02
"""Seconds between two looks."""


@contextlib.contextmanager
def turn(place: Path, key: str) -> Iterator[None]:
    """Within the block, hold the lock that allows one process or thread to build an entry. If another process has the
    lock, wait.

    The lock is released explicitly, because a forked process with a copy of the handle would keep it. On file systems
    without locks, no process waits.
    """
    path = place / f".turn-{key[:16]}"
    handle = _taken(path)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        unlock(handle)
        os.close(handle)


def _taken(path: Path) -> int:
    """The lock file, open and locked. A file that was removed before it was locked excludes no other process: it is made
    and locked again."""
    until = time.monotonic() + LONGEST
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
        if not can_lock(handle):
            return handle
        while not lock(handle, wait=False):
            if time.monotonic() > until:
                return handle
            time.sleep(BETWEEN)
        if os.fstat(handle).st_nlink:
            return handle
        os.close(handle)
