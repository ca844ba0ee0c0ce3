"""The date of a log's recording, from its rows."""

from __future__ import annotations

from datetime import UTC, datetime

EARLIEST, LATEST = 9.0e8, 4.0e9
"""s since 1970 that are taken for a date: 1998 to 2096."""


def date_of(first_time: float) -> str:
    """The date (UTC) of a first row whose time (s) counts from 1970, else empty. The file's own date is not used: it
    changes with copying, and the same log must give the same calibrated file."""
    if not EARLIEST < first_time < LATEST:
        return ""
    return datetime.fromtimestamp(first_time, UTC).date().isoformat()
