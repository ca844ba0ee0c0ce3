"""Turn errors of the command line into one line, a hint and an exit status. Only --debug shows a traceback."""

from __future__ import annotations

import contextlib
import io
import os
import sys

from psdmc.cli import interrupt
from psdmc.cli.commands import app
from psdmc.cli.lists import with_numbers_joined
from psdmc.cli.output import one_line
from psdmc.errors import CLOSED_STATUS, INTERRUPTED_STATUS, InternalError, PsdmcError, ToolchainError

INTERNAL_STATUS = 70


def run(arguments: list[str] | None = None) -> None:
    """Run the command line."""
    words = sys.argv[1:] if arguments is None else arguments
    # Names that the terminal's encoding lacks are printed as escapes.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with interrupt.as_error():
            _run(words)
    except PsdmcError as error:
        _fail(words, error.message, error.hint, error.exit_status)
    except InternalError as error:
        _fail(words, f"internal: {error}", "this is a bug in psdmc: please report it", INTERNAL_STATUS)
    except (KeyboardInterrupt, interrupt.Interrupted):
        _fail(words, "interrupted", None, INTERRUPTED_STATUS)
    except BrokenPipeError:
        _silence(sys.stdout)
        sys.exit(CLOSED_STATUS)
    except MemoryError:
        hint = "close other programs; or leave E and P out: derive --no-expand"
        _fail(words, "not enough memory", hint, ToolchainError.exit_status)
    except OSError as error:
        _fail(words, _described(error), None, ToolchainError.exit_status)


def _run(words: list[str]) -> None:
    """Run the command and flush its output: a full disk behind standard output raises here."""
    try:
        app(with_numbers_joined(words), prog_name="psdmc")
    except SystemExit as left:
        with contextlib.suppress(BrokenPipeError) if left.code else contextlib.nullcontext():
            sys.stdout.flush()
        raise


def _described(error: OSError) -> str:
    """The message of an OSError that no stage has described."""
    if error.filename is None:
        _silence(sys.stdout)
        return f"standard output: {error.strerror or error}"
    return f"{error.filename}: {error.strerror}"


def _fail(words: list[str], message: str, hint: str | None, status: int) -> None:
    """Print and exit; called inside an `except`, so that --debug can show the traceback."""
    if "--debug" in words:
        raise
    said = [f"error: {one_line(message)}", *([f"hint: {one_line(hint)}"] if hint else [])]
    with contextlib.suppress(OSError):
        if sys.stderr is not None:  # closed by the caller
            print("\n".join(said), file=sys.stderr)
    sys.exit(status)


def _silence(stream: object) -> None:
    """Discard what is still in a stream's buffer: Python would otherwise report it when it ends."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        target = os.open(os.devnull, os.O_WRONLY)
        os.dup2(target, stream.fileno())  # type: ignore[attr-defined]
        os.close(target)
