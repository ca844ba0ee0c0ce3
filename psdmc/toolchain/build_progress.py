"""How far a build is: by the object files that have come into its folder."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from psdmc.progress import Progress, Step

TICK = 0.25
"""s between two looks."""

OBJECTS = ("*.o", "*.obj")

FOLDERS = ("src", "test")
"""Of a package, as CMake names them in its build folder: objects elsewhere are of CMake's own trials."""


@contextmanager
def told(build: Path, files: int, progress: Progress) -> Iterator[None]:
    """Tell `progress` of the share of `files` object files that have come below `build`, until the block ends.

    A compiler says nothing while it works: without this a build would be one step, however long. Files of an earlier
    build are there from the beginning, and then the time left is not known.
    """
    done = threading.Event()

    def watch() -> None:
        while not done.wait(TICK):
            progress(_step(build, files))

    progress(_step(build, files))
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


def _step(build: Path, files: int) -> Step:
    count = 0
    with suppress(OSError):  # a folder that the build takes away at this moment
        found = [path.parent for pattern in OBJECTS for path in build.rglob(pattern)]
        count = min(files, sum(1 for folder in found if folder == build or folder.name in FOLDERS))
    return Step(f"building: {count} of {files} files", count / max(files, 1))
