"""psdmc's command line in a process that can be killed: forked from this one, so that no time goes into imports."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
import traceback
from pathlib import Path

import psdmc.cli.measuring  # noqa: F401  loaded before the fork
from psdmc.cli import main

NOT_ENDED = 99


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
    code = NOT_ENDED
    try:
        os.setsid()
        os.chdir(folder)
        said = os.open(folder.parent / f"{folder.name}.said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(said, 1)
        os.dup2(said, 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        main([str(word) for word in words])
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    except BaseException:  # what a user would see as a traceback is in what was said
        traceback.print_exc()
    finally:
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)
