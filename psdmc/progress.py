"""Progress of long work, told step by step."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str], None]
"""Called with the name of each step as it begins."""


def silent(step: str) -> None:
    """Ignore progress: the default where none is asked for."""
