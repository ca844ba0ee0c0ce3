"""Opens files from other programs with a limit of their size, and converts every error of a decoder to an InputError. It
also limits the size of tables, the names of their columns, and the length of what messages repeat of a file."""

from __future__ import annotations

import stat
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from psdmc.errors import InputError, PsdmcError

LARGEST_FILE = 2 * 1024**3
"""Bytes of a table or bag: two hours of seven joints at 1 kHz as text, which a workstation's memory holds."""
LARGEST_STORED = 64 * 1024**3
"""Bytes of a table or bag that is read in pieces: a day of seven joints at 1 kHz as text."""
LARGEST_TOML = 256 * 1024
"""Bytes of a campaign or plant: a thousand runs; beyond that the standard library's reader takes seconds."""

SHORTER = "cut it into several"
WRITE_AGAIN = "record, export or copy it again; the format goes by the file's ending"


def is_folder(path: Path) -> bool:
    """Return whether a folder with this name exists. A name that no file can have counts as missing."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


@contextmanager
def opened(path: Path, largest: int = LARGEST_FILE) -> Iterator[BinaryIO]:
    """Return the file, open for bytes. Raises InputError if it is no readable file of 1 to `largest` bytes."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path}: is not a file", "give the path of a file")
        if status.st_size == 0:
            raise InputError(f"{path}: is empty", "record or export it again")
        if status.st_size > largest:
            raise InputError(f"{path}: has {status.st_size:,} bytes, expected at most {largest:,}", SHORTER)
        file = path.open("rb")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file", "check the path") from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise InputError(f"{path}: cannot be read: {_reason(error)}", "check its path and rights") from error
    with file:
        yield file


@contextmanager
def decoding(name: str, what: str, hint: str = WRITE_AGAIN) -> Iterator[None]:
    """Within the block, convert all errors of a decoder to an InputError "NAME: not WHAT, or damaged: why".

    Decoders of damaged bytes raise many kinds of errors (struct.error, KeyError, AssertionError, MemoryError, ...).
    The cause is the file and not psdmc.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            yield
    except PsdmcError:
        raise
    except Exception as error:
        raise InputError(f"{name}: not {what}, or damaged: {_reason(error)}", hint) from error


def _reason(error: Exception) -> str:
    """The reason as one short line."""
    text = getattr(error, "strerror", None) or str(error)
    lines = text.strip().splitlines()
    return lines[0][: 2 * LONGEST_QUOTE] if lines else type(error).__name__


# Tables


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
    for what, count, largest in (("rows", rows, LARGEST_ROWS), ("columns", columns, LARGEST_COLUMNS)):
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


# What messages repeat of a file


LONGEST_QUOTE = 60
"""Characters of a file's text in a message."""
MOST_NAMES = 8
"""Names in one message."""
MOST_FAULTS = 3
"""Faults in one message: the first ones usually cause the others."""


def quoted(text: str) -> str:
    """Return a text of a file for a message: in quotes, with escaped control characters, and shortened if it is long."""
    return repr(text if len(text) <= LONGEST_QUOTE else text[:LONGEST_QUOTE] + "...")


def listed(names: Sequence[str], most: int = MOST_NAMES, between: str = ", ") -> str:
    """Return a list of names such as 'a, b, c and 9 more'."""
    shown = between.join(names[:most])
    return shown if len(names) <= most else f"{shown} and {len(names) - most} more"


def first_faults(faults: Sequence[str]) -> str:
    """Return a list of faults such as 'this; that and 9 more'."""
    return listed(faults, MOST_FAULTS, "; ")
