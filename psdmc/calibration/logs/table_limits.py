"""Limits of the size of a table and of the names of its columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from psdmc.calibration.logs.wording import listed, quoted
from psdmc.errors import InputError

LARGEST_ROWS = 20_000_000
"""Five hours at 1 kHz."""
LARGEST_STORED_ROWS = 100_000_000
"""Of a log that is read in pieces: a day at 1 kHz."""
LARGEST_COLUMNS = 1_000
"""Ten per joint of the longest chains, and as many that are not read."""
LARGEST_VALUES = 100_000_000
"""Rows times columns: 800 MB; an hour of seven joints at 1 kHz has 80 million."""
LARGEST_EXPANSION = 200
"""Bytes of numbers from one byte of a packed file; real logs, whose noise is incompressible, stay below 20."""
ALWAYS_ALLOWED = 64 * 1024**2
"""Bytes of numbers that every file may unpack to."""


def require_size(rows: int, columns: int, file_bytes: int, name: str) -> None:
    """Raise InputError if a table has too many rows, columns or values. The check needs only the table's size."""
    found, most = (rows, columns), (LARGEST_ROWS, LARGEST_COLUMNS)
    for what, count, largest in zip(("rows", "columns"), found, most, strict=True):
        if count > largest:
            raise InputError(
                f"{name}: {count:,} {what}, expected at most {largest:,}",
                "cut it into several, or leave columns out",
            )
    if rows * columns > LARGEST_VALUES:
        raise InputError(
            f"{name}: {rows:,} rows of {columns} columns, expected at most {LARGEST_VALUES:,} numbers",
            "cut the log into several, or leave columns out",
        )
    require_unpacked(8 * rows * columns, file_bytes, name)


def require_unpacked(size: int, file_bytes: int, name: str) -> None:
    """Raise InputError if a compressed file claims to unpack to more bytes than is plausible for its size."""
    allowed = max(ALWAYS_ALLOWED, LARGEST_EXPANSION * file_bytes)
    if size > allowed:
        raise InputError(
            f"{name}: {file_bytes:,} bytes that unpack to {size:,}, expected at most {allowed:,}",
            "write it again without packing",
        )


def require_names(names: Sequence[str], name: str) -> None:
    """Raise InputError if there are too many columns, or if a name occurs twice or contains control characters."""
    require_size(0, len(names), 0, name)
    twice = [quoted(column) for column, count in Counter(names).items() if count > 1]
    if twice:
        raise InputError(f"{name}: column(s) named twice: {listed(twice)}", "leave one of each out")
    odd = [quoted(column) for column in names if not column.isprintable()]
    if odd:
        raise InputError(
            f"{name}: control characters in the name of column(s) {listed(odd)}", "rename the column"
        )
