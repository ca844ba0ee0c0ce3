"""One builder at a time for each entry of the compile cache: others wait for it and use what it made."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path

from psdmc.atomic import can_lock, lock, unlock

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
