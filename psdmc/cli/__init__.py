"""The command line: arguments, progress, tables, the error boundary. No mathematics."""

from __future__ import annotations

from psdmc.cli.interrupt import as_error, at_once

__all__ = ["main"]


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; Ctrl-C ends it without a traceback, from here on."""
    with at_once():
        from psdmc.cli.boundary import run
    with as_error():
        run(arguments)
