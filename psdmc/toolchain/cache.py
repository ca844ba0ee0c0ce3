"""Compiled libraries by content: each is compiled once.

The key covers everything that the binary depends on: sources, flags, compiler, CPU features, psdmc's version and the
platform. An entry is used while its files have the digests that they were sealed with, and is built again otherwise.
A process that needs an entry while another one builds it waits and uses it. Where files cannot be locked, two may build
the same entry, each in a folder of its own that it renames into place: the later one uses the earlier one's.
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

from psdmc.atomic import can_lock, lock, unlock
from psdmc.errors import ToolchainError
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
    """Hex digest of file names, texts and everything else that the binary depends on."""
    platform = (sys.platform, sysconfig.get_platform(), str(sysconfig.get_config_var("SOABI")))
    digest = hashlib.sha256()
    for part in (*platform, *parts, *(item for path in sorted(files) for item in (path, files[path]))):
        data = part.encode("utf-8")
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()


def cached(key: str, build: Callable[[Path], None], products: Sequence[str] = ()) -> Path:
    """The folder that `build` filled for this key, now or earlier, unaltered since.

    products  files that it must have made

    ToolchainError where the cache cannot be written or other users may write it, or where a product is missing.
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
    """The folder kept for a key, unaltered; None where there is none. ToolchainError as `cached`."""
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
    """Hold the only right to build an entry, waiting for the process or thread that has it.

    The lock is given back explicitly: a process that was forked meanwhile has a copy of the handle, which would keep it.
    Where the file system has no locks, no process waits.
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
