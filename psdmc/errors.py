"""Errors that people meet, and the one that they should not.

Every error a user can cause carries what and where in its message and, where there is one, the remedy in `hint`.
The command line prints both on one line each and ends with `exit_status`; only `--debug` shows a traceback.
"""

from __future__ import annotations

import sys
from collections.abc import Callable


class PsdmcError(Exception):
    """Something outside psdmc is not as it should be; `hint` says what would help."""

    exit_status = 1

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class InputError(PsdmcError):
    """A file, an option or an argument is wrong: change the input."""

    exit_status = 2


class DerivationError(PsdmcError):
    """The robot is fine but this model of it cannot be derived: change the options."""

    exit_status = 3


class ToolchainError(PsdmcError):
    """A compiler or a folder failed: change the machine."""

    exit_status = 4


class InternalError(Exception):
    """A broken invariant inside psdmc; never the input's fault."""


INTERRUPTED_STATUS = 130
"""Of a process that Ctrl-C ended, as shells say it: 128 + SIGINT."""


def exit_status_of(action: Callable[[], int | None]) -> int:
    """Run `action`, for `python -m` modules; its status (None: 0), or that of what ended it: a PsdmcError, Ctrl-C, or a
    standard output that takes no more. The reason is printed to standard error, a line, its hint below."""
    try:
        status = action() or 0
        sys.stdout.flush()
        return status
    except PsdmcError as error:
        return _failed(error.message, error.hint, error.exit_status)
    except KeyboardInterrupt:
        return _failed("interrupted", None, INTERRUPTED_STATUS)
    except OSError as error:
        where = error.filename or "standard output"
        sys.stdout = None  # what is left in its buffer cannot be said either
        return _failed(f"{where}: {error.strerror}", "free some space", ToolchainError.exit_status)


def _failed(message: str, hint: str | None, status: int) -> int:
    print(f"error: {message}", *([f"hint: {hint}"] if hint else []), sep="\n", file=sys.stderr)
    return status
