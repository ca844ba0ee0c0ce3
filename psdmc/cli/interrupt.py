"""Ctrl-C: exit at once while modules load, an error of one line at any other time; never a traceback."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from psdmc.errors import INTERRUPTED_STATUS

IMPORT_SYSTEM = "<frozen importlib."
"""What the file names of the import system's own code begin with."""


class Interrupted(BaseException):
    """Ctrl-C. Not a KeyboardInterrupt, which libraries turn into statuses and messages of their own."""


def at_once() -> contextlib.AbstractContextManager[None]:
    """Exit where Ctrl-C comes: no work has begun, and modules that are being loaded do not pass exceptions on."""
    return _handled(_leave)


def as_error() -> contextlib.AbstractContextManager[None]:
    """Raise Interrupted where Ctrl-C comes; exit at once where it comes while a command loads a module."""
    return _handled(_raise_or_leave)


def _leave(number: int, frame: FrameType | None) -> None:
    os.write(2, b"error: interrupted\n")
    os._exit(INTERRUPTED_STATUS)


def _raise_or_leave(number: int, frame: FrameType | None) -> None:
    if _loads_a_module(frame):
        _leave(number, frame)
    raise Interrupted


def _loads_a_module(frame: FrameType | None) -> bool:
    """Whether an import is under way: a compiled module replaces any exception by an ImportError of its own."""
    while frame is not None:
        if frame.f_code.co_filename.startswith(IMPORT_SYSTEM):
            return True
        frame = frame.f_back
    return False


@contextlib.contextmanager
def _handled(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Replace Python's own handler or the one of `at_once`, and no other: a caller's handler, or a shell's choice to ignore
    Ctrl-C, stays."""
    before = signal.getsignal(signal.SIGINT)
    is_ours = (
        before in (signal.default_int_handler, _leave)
        and threading.current_thread() is threading.main_thread()
    )
    if not is_ours:
        yield
        return
    signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
