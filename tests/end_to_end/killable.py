"""psdmc's command line in a process that can be killed: forked from this one, so that no time goes into imports."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

from command_line import become

import psdmc.cli.commands  # noqa: F401  loaded before the fork


def run(words: list[object], folder: Path, kill_after: float | None = None) -> int:
    """Exit status of `psdmc WORDS` in `folder`; -9 where it was killed, with all it started, after that many s."""
    child = os.fork()
    if child == 0:
        _become(words, folder)
    if kill_after is not None:
        time.sleep(kill_after)
        os.killpg(child, signal.SIGKILL) if os.getpgid(child) == child else os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _become(words: list[object], folder: Path) -> None:
    os.setsid()
    said = os.open(folder.parent / f"{folder.name}.said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    become(words, folder, {}, said, said)
