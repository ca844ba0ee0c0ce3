"""The line that a command ends with: what to type next."""

from __future__ import annotations

import contextlib
import shlex
import sys


def say_next(*words: object) -> None:
    """Print `next: psdmc WORDS`, quoted for a shell, to standard error: standard output holds results alone."""
    say_next_line(shlex.join(["psdmc", *map(str, words)]))


def quoted(word: object) -> str:
    """A word as a shell takes it."""
    return shlex.quote(str(word))


def say_next_line(line: str) -> None:
    """Print `next: LINE` likewise, below the results: where they cannot be written, nothing is next."""
    sys.stdout.flush()
    with contextlib.suppress(OSError):  # whoever closed it does not want to know
        if sys.stderr is not None:
            print(f"next: {one_line(line)}", file=sys.stderr)


def one_line(text: str) -> str:
    """Untrusted text on one line of a terminal: control characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
