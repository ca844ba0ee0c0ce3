"""What each process of the race for the compile cache does; apart, so that a fresh process imports little."""

from __future__ import annotations

import time
from multiprocessing.synchronize import Barrier
from pathlib import Path

from psdmc.toolchain.cache import cached


def race(barrier: Barrier, log: str, number: int) -> None:
    """Build for one key at the same moment as all others, slowly, and note who built and whose build won."""

    def build(folder: Path) -> None:
        with open(f"{log}-builds", "a", encoding="utf-8") as stream:
            stream.write(f"{number}\n")
        time.sleep(0.2)
        (folder / "who").write_text(str(number))

    barrier.wait()
    winner = (cached("r" * 64, build) / "who").read_text()
    with open(log, "a", encoding="utf-8") as stream:
        stream.write(f"{winner}\n")
