"""Turns errors and Ctrl-C of the command line into one line, a hint and an exit status. Only --debug shows a traceback.

The option --version loads this module, so functions import what else they need. While other modules load, Ctrl-C ends
psdmc at once; at any other time it raises Interrupted.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType

from psdmc.errors import (
    CLOSED_STATUS,
    INTERRUPTED_STATUS,
    InternalError,
    PsdmcError,
    ToolchainError,
    drop_output,
)

INTERNAL_STATUS = 70

IMPORT_SYSTEM = "<frozen importlib."
"""What the file names of the import system's own code begin with."""


def run(arguments: list[str] | None = None) -> None:
    """Run the command line."""
    from psdmc.cli.arguments import with_numbers_joined
    from psdmc.cli.commands import app

    words = sys.argv[1:] if arguments is None else arguments
    # Names that the terminal's encoding lacks are printed as escapes.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with as_error():
            _flushed(app, with_numbers_joined(words))
    except PsdmcError as error:
        _fail(words, error.message, error.hint, error.exit_status)
    except InternalError as error:
        _fail(words, f"internal: {error}", "this is a bug in psdmc: please report it", INTERNAL_STATUS)
    except (KeyboardInterrupt, Interrupted):
        _fail(words, "interrupted", None, INTERRUPTED_STATUS)
    except BrokenPipeError:
        drop_output()
        sys.exit(CLOSED_STATUS)
    except MemoryError:
        hint = "close other programs; or leave E and P out: derive --no-expand"
        _fail(words, "not enough memory", hint, ToolchainError.exit_status)
    except OSError as error:
        _fail(words, _described(error), None, ToolchainError.exit_status)
    except ModuleNotFoundError as error:
        if not error.name or error.name.partition(".")[0] == "psdmc":
            raise
        hint = "pip install psdmc installs it; psdmc doctor lists everything that is missing"
        _fail(words, f"the Python package {error.name} is not installed", hint, ToolchainError.exit_status)


def _flushed(app: Callable[..., None], words: list[str]) -> None:
    """Run the command and flush its output: a full disk behind standard output raises here."""
    try:
        app(words, prog_name="psdmc")
    except SystemExit as left:
        with contextlib.suppress(BrokenPipeError) if left.code else contextlib.nullcontext():
            sys.stdout.flush()
        raise


def _described(error: OSError) -> str:
    """The message of an OSError that no stage has described."""
    if error.filename is None:
        drop_output()
        return f"standard output: {error.strerror or error}"
    return f"{error.filename}: {error.strerror}"


def _fail(words: list[str], message: str, hint: str | None, status: int) -> None:
    """Print and exit; called inside an `except`, so that --debug can show the traceback."""
    from psdmc.cli.console import one_line

    if "--debug" in words:
        raise
    said = [f"error: {one_line(message)}", *([f"hint: {one_line(hint)}"] if hint else [])]
    with contextlib.suppress(OSError):
        if sys.stderr is not None:  # closed by the caller
            print("\n".join(said), file=sys.stderr)
    sys.exit(status)


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
