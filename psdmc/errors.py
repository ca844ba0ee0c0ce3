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


def exit_status_of(action: Callable[[], int | None]) -> int:
    """Run `action`, for `python -m` modules; its status (None: 0), or that of its PsdmcError, whose message and hint
    are printed to standard error, a line each."""
    try:
        return action() or 0
    except PsdmcError as error:
        print(f"error: {error.message}", f"hint: {error.hint}", sep="\n", file=sys.stderr)
        return error.exit_status
