"""The errors that psdmc raises: three that a user can cause, and one for faults of psdmc itself.

The message of an error says what is wrong and where, and its `hint` gives the remedy, if there is one. The command
line prints each on one line and ends with the error's `exit_status`. It shows a traceback only with `--debug`.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable

INTERRUPTED_STATUS = 130
"""Exit status of a process that Ctrl-C ended, as shells define it: 128 + SIGINT."""
CLOSED_STATUS = 1
"""Exit status where the reader of the output has closed it (`psdmc show m.npz | head`): nothing failed, but the output
is incomplete."""
WARNING = "warning: "
"""The beginning of a note on a robot if the note is a warning."""


class PsdmcError(Exception):
    """Base class of the errors that a user can cause.

    The attribute `message` says what is wrong, and the attribute `hint` says what to do. A traceback prints both.
    """

    exit_status = 1

    def __init__(self, message: str, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        if hint is not None:
            self.add_note(f"hint: {hint}")


class InputError(PsdmcError):
    """psdmc raises this error if an input file, an option or an argument is wrong.

    If a psdmc command fails with an InputError, its exit status is 2.
    """

    exit_status = 2


class DerivationError(PsdmcError):
    """psdmc raises this error if it cannot derive a model with the given options, although the robot file has no mistake.

    For example, the matrices E and P (the formula of the torques) of a robot with many joints can need too much memory.
    The option `expand=False` leaves out E and P. If a psdmc command fails with a DerivationError, its exit status is 3.
    """

    exit_status = 3


class ToolchainError(PsdmcError):
    """psdmc raises this error if the cause lies in the machine: a program is missing or fails, or a disk is full.

    If a psdmc command fails with a ToolchainError, its exit status is 4.
    """

    exit_status = 4


class InternalError(Exception):
    """psdmc raises this error if psdmc itself has a bug. Please report the error message and your input.

    If a psdmc command fails with an InternalError, its exit status is 70.
    """


def exit_status_of(action: Callable[[], int | None]) -> int:
    """Run `action`, the main function of a `python -m` module, and return its exit status (None counts as 0).

    If `action` raises a PsdmcError, this function prints its message and hint to standard error, one line each, and
    returns the status of that error. Ctrl-C also gives one line, and so does a full disk to which standard output is
    written. If standard output is closed, nothing is printed.
    """
    discard_output_if_closed()
    try:
        status = action() or 0
        sys.stdout.flush()
        return status
    except PsdmcError as error:
        return _said(error.message, error.hint, error.exit_status)
    except KeyboardInterrupt:
        return _said("interrupted", None, INTERRUPTED_STATUS)
    except BrokenPipeError:
        drop_output()
        return CLOSED_STATUS
    except OSError as error:
        if error.filename is None:
            drop_output()
        where = error.filename or "standard output"
        return _said(f"{where}: {error.strerror or error}", "free some space", ToolchainError.exit_status)


def discard_output_if_closed() -> None:
    """If the caller closed standard output (`psdmc derive robot.urdf >&-`), let print write to the null device."""
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def _said(message: str, hint: str | None, status: int) -> int:
    print(f"error: {message}", *([f"hint: {hint}"] if hint else []), sep="\n", file=sys.stderr)
    return status


def drop_output() -> None:
    """Discard what is still in standard output's buffer: Python would otherwise report it when it ends."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
