"""Where errors end: one line, a hint and an exit status; a traceback only with --debug."""

from __future__ import annotations

import sys

from psdmc.cli.commands import app
from psdmc.errors import InternalError, PsdmcError

INTERNAL_STATUS = 70
INTERRUPTED_STATUS = 130


def main(arguments: list[str] | None = None) -> None:
    """Run the command line."""
    words = sys.argv[1:] if arguments is None else arguments
    try:
        app(words)
    except PsdmcError as error:
        _fail(words, error.message, error.hint, error.exit_status)
    except InternalError as error:
        _fail(words, f"internal: {error}", "this is a bug in psdmc: please report it", INTERNAL_STATUS)
    except KeyboardInterrupt:
        _fail(words, "interrupted", None, INTERRUPTED_STATUS)


def _fail(words: list[str], message: str, hint: str | None, status: int) -> None:
    """Print and leave; inside an `except`, so that --debug can show where it came from."""
    if "--debug" in words:
        raise
    print("error: " + one_line(message), file=sys.stderr)
    if hint:
        print("hint: " + one_line(hint), file=sys.stderr)
    sys.exit(status)


def one_line(text: str) -> str:
    """Untrusted text on one line of a terminal: control characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
