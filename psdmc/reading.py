"""Reads files of other programs up to a stated size. psdmc reads every whole file with these functions.

A device or a pipe may never end, and a file may grow while psdmc reads it. So psdmc counts the bytes itself and does
not rely on the size that the operating system states.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO

from psdmc.errors import InputError

PIECE = 1 << 20
"""Bytes that are asked for at once, so that memory grows with what is there and not with the limit."""


def read_file(
    path: str | os.PathLike[str], most: int, hint: str, begins: bytes = b"", name: str | None = None
) -> bytes:
    """Return the content of a file, pipe or device. Arguments and other errors are those of read_rest. Raises OSError
    if the file cannot be read."""
    with Path(path).open("rb") as file:
        named = name or os.fspath(path)
        if os.fstat(file.fileno()).st_size > most:
            raise _too_much(named, most, hint)
        return read_rest(file, most, named, hint, begins)


def read_rest(file: BinaryIO, most: int, name: str, hint: str, begins: bytes = b"") -> bytes:
    """Return the bytes that are left in an open file. The function reads at most one byte more than `most`.

    begins   expected first bytes; if the file begins with other bytes, only the first bytes of the file are returned

    Raises InputError, which calls the file `name`, if more than `most` bytes are left.
    """
    found = bytearray(_up_to(file, len(begins)))
    if found != begins:
        return bytes(found)
    while len(found) <= most:
        piece = file.read(min(PIECE, most + 1 - len(found)))
        if not piece:
            return bytes(found)
        found += piece
    raise _too_much(name, most, hint)


def _too_much(name: str, most: int, hint: str) -> InputError:
    return InputError(f"{name}: more than {in_words(most)}, which is the most that psdmc reads", hint)


def _up_to(file: BinaryIO, count: int) -> bytes:
    """So many bytes; fewer where the file ends."""
    found = b""
    while len(found) < count and (piece := file.read(count - len(found))):
        found += piece
    return found


def in_words(size: int) -> str:
    """Return a size in bytes as a text for messages, such as '64 MiB'."""
    for unit, bits in (("GiB", 30), ("MiB", 20), ("KiB", 10)):
        if size >= 1 << bits and size % (1 << bits) == 0:
            return f"{size >> bits} {unit}"
    return f"{size:,} bytes"
