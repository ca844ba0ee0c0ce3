"""Print the last line of a command, which shows the next command to type."""

from __future__ import annotations

import contextlib
import shlex
import sys


def say_next(*words: object) -> None:
    """Print `next: psdmc WORDS`, quoted for a shell, to standard error, because standard output has only results."""
    say_next_line(shlex.join(["psdmc", *map(str, words)]))


def quoted(word: object) -> str:
    """A word as a shell takes it."""
    return shlex.quote(str(word))


def say_next_line(line: str) -> None:
    """Print `next: LINE` to standard error, after the results. Print nothing if the results cannot be written."""
    sys.stdout.flush()
    with contextlib.suppress(OSError):  # whoever closed it does not want to know
        if sys.stderr is not None:
            print(f"next: {one_line(line)}", file=sys.stderr)


def one_line(text: str) -> str:
    """Return untrusted text without control characters, which are escaped, so that it fits on one line of a terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
