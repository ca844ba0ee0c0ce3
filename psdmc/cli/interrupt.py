"""Handles Ctrl-C: psdmc exits at once while modules load, and prints an error of one line at any other time."""

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
    """The exception that Ctrl-C raises. It is no KeyboardInterrupt, because libraries catch that and continue."""


def at_once() -> contextlib.AbstractContextManager[None]:
    """While this context is open, Ctrl-C ends the process at once: loading modules may swallow exceptions."""
    return _handled(_leave)


def as_error() -> contextlib.AbstractContextManager[None]:
    """While this context is open, Ctrl-C raises Interrupted, or ends the process at once if a module is being loaded."""
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
    """Replace Python's own handler or that of `at_once`; a caller's handler, or a shell's choice to ignore, stays."""
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
