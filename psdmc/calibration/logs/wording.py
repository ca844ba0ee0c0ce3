"""Shortens long lists in messages to the first entries and the number of the others."""

from __future__ import annotations

from collections.abc import Sequence

MOST_NAMES = 8
"""Names in one message."""
MOST_FAULTS = 3
"""Faults in one message: the first ones usually cause the others."""


def listed(names: Sequence[str], most: int = MOST_NAMES) -> str:
    """Return a list of names such as 'a, b, c and 9 more'."""
    return _first(names, most, ", ")


def first_faults(faults: Sequence[str], most: int = MOST_FAULTS) -> str:
    """Return a list of faults such as 'this; that and 9 more'."""
    return _first(faults, most, "; ")


def _first(texts: Sequence[str], most: int, between: str) -> str:
    shown = between.join(texts[:most])
    return shown if len(texts) <= most else f"{shown} and {len(texts) - most} more"


def quoted(text: str) -> str:
    """Return a text of a file for a message: in quotes, with escaped control characters, and shortened if it is long."""
    return repr(text if len(text) <= LONGEST_QUOTE else text[:LONGEST_QUOTE] + "...")


LONGEST_QUOTE = 60
"""Characters of a file's text in a message."""
