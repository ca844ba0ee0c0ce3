"""The command line of psdmc: its arguments, progress, tables and error messages. No mathematics is here."""

from __future__ import annotations

import sys

from psdmc.cli.boundary import at_once, run
from psdmc.errors import discard_output_if_closed, exit_status_of
from psdmc.version import psdmc_version

__all__ = ["main"]


def main(arguments: list[str] | None = None) -> None:
    """Run the command line. From here on, Ctrl-C ends psdmc without a traceback. The option --version imports no other
    modules."""
    discard_output_if_closed()
    if (sys.argv[1:] if arguments is None else arguments) == ["--version"]:
        sys.exit(exit_status_of(_print_version))
    with at_once():
        run(arguments)


def _print_version() -> None:
    print(f"psdmc {psdmc_version()}")
