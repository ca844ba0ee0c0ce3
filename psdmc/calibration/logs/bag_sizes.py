"""Limits the size of compressed bags before a reader allocates memory for their content.

rosbag2 compresses whole files, single messages, or chunks of an MCAP file. A damaged file can state a wrong unpacked
size, on which readers would rely.
"""

from __future__ import annotations

import io
import sqlite3
import struct
import sys
import tempfile
from bz2 import BZ2Decompressor
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, BinaryIO

from psdmc.calibration.logs.foreign_bytes import (
    ALWAYS_ALLOWED,
    LARGEST_EXPANSION,
    LARGEST_FILE,
    WRITE_AGAIN,
    decoding,
    opened,
)
from psdmc.errors import InputError

PACKED = ".zstd"
"""Ending of a bag's file that is packed as a whole."""
SMALLER = "record the bag again without compression, or cut it into several"
MAGIC = b"\x89MCAP0\r\n"
FOOTER, CHUNK, CHUNK_INDEX = 0x02, 0x06, 0x08
HEAD = struct.Struct("<BQ")
"""Kind and length of a record."""
FROM_FOOTER = len(MAGIC) + 20
"""Bytes from the footer's content to the end: two offsets, a checksum, and the magic again."""
CHUNK_HEAD = struct.Struct("<QQQII")
"""Of a chunk: first and last time, unpacked size, checksum, length of the compression's name; packed size follows it."""
LONGEST_PACKING = 100
"""Bytes of a compression's name."""
SIZES = struct.Struct("<QQ")
"""The end of a chunk's index: packed and unpacked size."""
PIECE = 2**20
"""Bytes packed or unpacked at once."""


def require_packed_file(file: Path) -> None:
    """Raise InputError if a compressed file unpacks to more bytes than is plausible for its size.

    The file is also unpacked into a temporary file. If the result is an MCAP file, its chunks are checked in the same
    way.
    """
    allowed = _allowed(file)
    with opened(file) as packed, tempfile.TemporaryDirectory() as folder:
        inside = Path(folder) / "inside"
        with decoding(str(file), "a packed ROS 2 bag"), inside.open("wb") as keep:
            size = unpacked_size(packed, file.stat().st_size, "zstd", allowed, keep)
        _require(size, allowed, file)
        if file.stem.lower().endswith(".mcap"):
            try:
                require_mcap_size(inside)
            except InputError as error:
                raise InputError(error.message.replace(str(inside), str(file)), error.hint) from error


def require_packed_messages(file: Path) -> None:
    """Raise InputError if messages compressed one by one unpack to more than the file's size makes plausible."""
    if file.suffix.lower() != ".db3":
        raise InputError(
            f"{file}: messages packed one by one in a file that is not SQLite's are not read",
            "record the bag again by `ros2 bag record --compression-mode file`, or without compression",
        )
    left = allowed = _allowed(file)
    uri = f"{file.absolute().as_uri()}?mode=ro&immutable=1"
    with decoding(str(file), "a packed ROS 2 bag"), closing(sqlite3.connect(uri, uri=True)) as connection:
        for (message,) in connection.execute("SELECT data FROM messages"):
            if isinstance(message, bytes):
                left -= unpacked_size(io.BytesIO(message), len(message), "zstd", left)
                _require(allowed - left, allowed, file)


def _allowed(file: Path) -> int:
    return min(LARGEST_FILE, max(ALWAYS_ALLOWED, LARGEST_EXPANSION * file.stat().st_size))


def _require(size: int, allowed: int, file: Path) -> None:
    if size > allowed:
        raise InputError(
            f"{file}: {file.stat().st_size:,} bytes that unpack to more than {allowed:,}", SMALLER
        )


def require_mcap_size(path: Path) -> None:
    """Raise InputError if the sizes that an MCAP file states are not plausible.

    The checks cover three cases. A record may not be longer than the file. Chunks and their index may not unpack to
    more bytes than is plausible for the file. They may not unpack to more bytes than their headers say.
    """
    with opened(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(f"{path}: not an MCAP file", "give a file that ros2 bag recorded")
        records = _records(file, path)
        for kind in (CHUNK, CHUNK_INDEX):
            _require_size([_claims(file, *record) for record in records if record[0] == kind], file, path)
        _require_summary(file, records, path)
        with decoding(str(path), "an MCAP file"):
            _require_claims(file, records, path)


def _require_size(claims: list[tuple[int, int]], file: BinaryIO, path: Path) -> None:
    """InputError where `claims` (packed and unpacked sizes of chunks) exceed what the file's size allows."""
    file_bytes = file.seek(0, 2)
    packed, unpacked = (sum(sizes) for sizes in zip(*claims, strict=True)) if claims else (0, 0)
    allowed = max(ALWAYS_ALLOWED, LARGEST_EXPANSION * file_bytes)
    if unpacked > allowed:
        raise InputError(f"{path}: unpacks to {unpacked:,} bytes, expected at most {allowed:,}", SMALLER)
    if packed > file_bytes:
        raise InputError(
            f"{path}: damaged: chunks of {packed:,} bytes in a file of {file_bytes:,}", WRITE_AGAIN
        )


def _records(file: BinaryIO, path: Path) -> list[tuple[int, int, int]]:
    """Kind, offset (of the head) and length of every record up to the footer or the end."""
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


def _claims(file: BinaryIO, kind: int, place: int, length: int) -> tuple[int, int]:
    """Packed and unpacked size in the head of a chunk, or of its index entry; none where the record is too short."""
    start = place + HEAD.size
    if kind == CHUNK_INDEX:
        file.seek(start + max(length - SIZES.size, 0))
        packed, unpacked = SIZES.unpack(file.read(SIZES.size)) if length >= SIZES.size else (0, 0)
        return packed, unpacked
    file.seek(start)
    head = file.read(CHUNK_HEAD.size) if length >= CHUNK_HEAD.size else b""
    if not head:
        return 0, 0
    _, _, unpacked, _, name = CHUNK_HEAD.unpack(head)
    file.seek(start + CHUNK_HEAD.size + name)
    size = file.read(8)
    return struct.unpack("<Q", size)[0] if len(size) == 8 else 0, unpacked


def _require_summary(file: BinaryIO, records: list[tuple[int, int, int]], path: Path) -> None:
    """InputError where the footer at the file's end points to no record, whose length would be arbitrary bytes."""
    file.seek(max(file.seek(0, 2) - FROM_FOOTER, 0))
    footer = file.read(8)
    summary = struct.unpack("<Q", footer)[0] if len(footer) == 8 else 0
    if summary and summary not in [place for _, place, _ in records]:
        raise InputError(f"{path}: damaged: its summary is not where its footer says", WRITE_AGAIN)


def _require_claims(file: BinaryIO, records: list[tuple[int, int, int]], path: Path) -> None:
    """InputError where a chunk unpacks to more than its head says, or an index entry differs from its chunk's head."""
    chunks: dict[int, tuple[str, int, int]] = {}
    for kind, place, length in records:
        if kind == CHUNK and length >= CHUNK_HEAD.size + 8:
            packed, unpacked = _claims(file, kind, place, length)
            packing = _packing(file, place)
            chunks[place] = (packing, packed, unpacked)
            file.seek(place + HEAD.size + CHUNK_HEAD.size + len(packing.encode()) + 8)
            found = unpacked_size(file, min(packed, length), packing, unpacked)
            if found > unpacked:
                raise InputError(
                    f"{path}: damaged: the chunk at byte {place:,} unpacks to more than the {unpacked:,} bytes it says",
                    WRITE_AGAIN,
                )
    for kind, place, length in records:
        if kind == CHUNK_INDEX and _indexed(file, place, length) not in [
            (where, *claims) for where, claims in chunks.items()
        ]:
            raise InputError(f"{path}: damaged: its index is not that of its chunks", WRITE_AGAIN)


def _packing(file: BinaryIO, place: int) -> str:
    """A chunk's compression."""
    file.seek(place + HEAD.size + CHUNK_HEAD.size - 4)
    (length,) = struct.unpack("<I", file.read(4))
    return file.read(min(length, LONGEST_PACKING)).decode("ascii", "replace")


def _indexed(file: BinaryIO, place: int, length: int) -> tuple[int, str, int, int]:
    """The contents of a chunk's index entry: the chunk's offset, compression, packed and unpacked size."""
    file.seek(place + HEAD.size)
    content = file.read(length)
    (where,) = struct.unpack_from("<Q", content, 16)
    (offsets,) = struct.unpack_from("<I", content, 32)
    start = 36 + offsets + 8
    (name,) = struct.unpack_from("<I", content, start)
    packed, unpacked = SIZES.unpack_from(content, start + 4 + name)
    return where, content[start + 4 : start + 4 + name].decode("ascii", "replace"), packed, unpacked


def unpacked_size(file: BinaryIO, packed: int, packing: str, most: int, keep: BinaryIO | None = None) -> int:
    """Return the number of bytes to which the next `packed` bytes of a file unpack. Counting stops above `most`.

    keep     file into which the unpacked bytes are written; None: they are only counted
    packing  'bz2', 'lz4' or 'zstd'; for any other, 0
    """
    start = _unpackers().get(packing)
    if start is None:
        return 0
    unpacker, size = start(), 0
    while packed > 0 and size <= most:
        piece = file.read(min(PIECE, packed))
        if not piece:
            return size
        packed -= len(piece)
        while size <= most:
            if unpacker.eof:
                piece = unpacker.unused_data or b""
                if not piece:
                    break
                unpacker = start()
            out = unpacker.decompress(piece, max_length=PIECE)
            size += len(out)
            if keep is not None:
                keep.write(out)
            piece = b""
            if not out and not unpacker.eof:
                break
    return size


def _unpackers() -> dict[str, Callable[[], Any]]:
    try:
        from lz4.frame import LZ4FrameDecompressor

        if sys.version_info >= (3, 14):
            from compression.zstd import ZstdDecompressor
        else:
            from backports.zstd import ZstdDecompressor
    except ImportError as error:
        raise InputError(
            "packed ROS bags need lz4 and backports.zstd", "pip install 'psdmc[calibrate]'"
        ) from error
    return {"bz2": BZ2Decompressor, "lz4": LZ4FrameDecompressor, "zstd": ZstdDecompressor}


ROS1_MAGIC = b"#ROSBAG V2.0\n"
ROS1_CHUNK = b"op=\x05"


def require_ros1_sizes(file: BinaryIO, path: Path) -> None:
    """Raise InputError if a file is no ROS 1 bag, or if its chunks unpack to more than is plausible for its size.

    A bag is a list of records: the length of a header, its fields (each a length and NAME=VALUE), the length of the
    data, the data (https://wiki.ros.org/Bags/Format/2.0).
    """
    allowed, unpacked = _allowed(path), 0
    if file.read(len(ROS1_MAGIC)) != ROS1_MAGIC:
        raise InputError(f"{path}: not a ROS 1 bag of format 2.0", WRITE_AGAIN)
    with decoding(str(path), "a ROS 1 bag"):
        while head := file.read(4):
            fields = _ros1_fields(file.read(*struct.unpack("<I", head)))
            (length,) = struct.unpack("<I", file.read(4))
            end = file.tell() + length
            if ROS1_CHUNK in fields:
                packing = next((x[12:].decode() for x in fields if x.startswith(b"compression=")), "")
                unpacked += unpacked_size(file, length, packing, allowed - unpacked)
                _require(unpacked, allowed, path)
            file.seek(end)


def _ros1_fields(header: bytes) -> list[bytes]:
    """The fields of a record's header."""
    fields, place = [], 0
    while place < len(header):
        (length,) = struct.unpack_from("<I", header, place)
        fields.append(header[place + 4 : place + 4 + length])
        place += 4 + length
    return fields
