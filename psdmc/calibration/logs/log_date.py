"""When a log was recorded, as far as its file tells."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

EARLIEST, LATEST = 9.0e8, 4.0e9
"""s since 1970 that are believed as a date: 1998 to 2096."""


def date_of(first_time: float, path: Path) -> str:
    """A date (UTC): of the first row where time counts from 1970, else of the file."""
    if EARLIEST < first_time < LATEST:
        return _date(first_time)
    try:
        return f"file of {_date(path.stat().st_mtime)}"
    except (OSError, ValueError, OverflowError):
        return ""


def _date(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).date().isoformat()
