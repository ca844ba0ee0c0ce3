"""The command line: arguments, progress, tables, the error boundary. No mathematics."""

from psdmc.cli.boundary import main

__all__ = ["main"]
