"""How much an MCAP file says that it unpacks to, found from its records' heads before anything is unpacked."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from psdmc.calibrate.foreign_bytes import opened
from psdmc.calibrate.table_limits import ALWAYS_ALLOWED, LARGEST_EXPANSION
from psdmc.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
CHUNK, CHUNK_INDEX = 0x06, 0x08
_SIZE_AT = {CHUNK: 16, CHUNK_INDEX: None}
"""Bytes into a record at which a chunk's unpacked size stands; an index ends with it."""


def require_mcap_size(path: Path) -> None:
    """InputError where a file's chunks, or its index of them, unpack to more than its size allows."""
    with opened(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(f"{path}: not an MCAP file", "give a file that ros2 bag recorded")
        sizes = _unpacked(file)
        allowed = max(ALWAYS_ALLOWED, LARGEST_EXPANSION * file.seek(0, 2))
    if max(sizes.values()) > allowed:
        raise InputError(
            f"{path}: unpacks to {max(sizes.values()):,} bytes, expected at most {allowed:,}",
            "record the bag again without compression, or cut it into several",
        )


def _unpacked(file: BinaryIO) -> dict[int, int]:
    """Bytes that chunks and their index claim; a damaged record ends the count, for the reader to complain of."""
    total = {CHUNK: 0, CHUNK_INDEX: 0}
    end = file.seek(0, 2)
    place = len(MAGIC)
    while place + 9 <= end:
        file.seek(place)
        kind, length = struct.unpack("<BQ", file.read(9))
        if length > end - place - 9:
            break
        if kind in total:
            at = _SIZE_AT[kind]
            file.seek(place + 9 + (length - 8 if at is None else at))
            size = file.read(8)
            total[kind] += struct.unpack("<Q", size)[0] if len(size) == 8 else 0
        place += 9 + length
    return total
