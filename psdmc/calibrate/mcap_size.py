"""What an MCAP file's record heads say of sizes, looked at before its reader makes room for them."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from psdmc.calibrate.foreign_bytes import WRITE_AGAIN, opened
from psdmc.calibrate.table_limits import ALWAYS_ALLOWED, LARGEST_EXPANSION
from psdmc.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
FOOTER, CHUNK, CHUNK_INDEX = 0x02, 0x06, 0x08
HEAD = struct.Struct("<BQ")
"""Kind and length of a record."""
FROM_FOOTER = len(MAGIC) + 20
"""Bytes from the footer's content to the end: two places, a checksum, and the magic again."""
_SIZE_AT = {CHUNK: 16, CHUNK_INDEX: None}
"""Bytes into a record at which a chunk's unpacked size stands; an index ends with it."""


def require_mcap_size(path: Path) -> None:
    """InputError where a record is longer than the file, or chunks or their index unpack to more than its size allows."""
    with opened(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(f"{path}: not an MCAP file", "give a file that ros2 bag recorded")
        records = _records(file, path)
        _require_size(_unpacked(file, records), file.seek(0, 2), path)
        _require_summary(file, records, path)


def _require_size(sizes: dict[int, int], file_bytes: int, path: Path) -> None:
    allowed = max(ALWAYS_ALLOWED, LARGEST_EXPANSION * file_bytes)
    if max(sizes.values()) > allowed:
        raise InputError(
            f"{path}: unpacks to {max(sizes.values()):,} bytes, expected at most {allowed:,}",
            "record the bag again without compression, or cut it into several",
        )


def _records(file: BinaryIO, path: Path) -> list[tuple[int, int, int]]:
    """Kind, place (of the head) and length of every record up to the footer or the end."""
    found: list[tuple[int, int, int]] = []
    end, place = file.seek(0, 2), len(MAGIC)
    while place + HEAD.size <= end:
        file.seek(place)
        kind, length = HEAD.unpack(file.read(HEAD.size))
        if length > end - place - HEAD.size:
            raise InputError(
                f"{path}: damaged: a record of {length:,} bytes at byte {place:,} of {end:,}", WRITE_AGAIN
            )
        found.append((kind, place, length))
        if kind == FOOTER:
            break
        place += HEAD.size + length
    return found


def _unpacked(file: BinaryIO, records: list[tuple[int, int, int]]) -> dict[int, int]:
    """Bytes that chunks and their index claim."""
    total = {CHUNK: 0, CHUNK_INDEX: 0}
    for kind, place, length in records:
        if kind in total:
            at = _SIZE_AT[kind]
            file.seek(place + HEAD.size + (length - 8 if at is None else at))
            size = file.read(8)
            total[kind] += struct.unpack("<Q", size)[0] if len(size) == 8 else 0
    return total


def _require_summary(file: BinaryIO, records: list[tuple[int, int, int]], path: Path) -> None:
    """InputError where the footer at the file's end leads to what is no record: its length would be any bytes."""
    file.seek(max(file.seek(0, 2) - FROM_FOOTER, 0))
    footer = file.read(8)
    summary = struct.unpack("<Q", footer)[0] if len(footer) == 8 else 0
    if summary and summary not in [place for _, place, _ in records]:
        raise InputError(f"{path}: damaged: its summary is not where its footer says", WRITE_AGAIN)
