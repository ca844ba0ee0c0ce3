"""Bags that rosbag2 compressed, file by file or message by message: their unpacked size is bounded before they are
unpacked."""

from __future__ import annotations

import io
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from psdmc.calibration.logs.foreign_bytes import LARGEST_FILE, decoding, opened
from psdmc.calibration.logs.mcap_size import require_mcap_size
from psdmc.calibration.logs.table_limits import ALWAYS_ALLOWED, LARGEST_EXPANSION
from psdmc.calibration.logs.unpacked import unpacked_size
from psdmc.errors import InputError

PACKED = ".zstd"
"""Ending of a bag's file that is packed as a whole."""
SMALLER = "record the bag again without compression, or cut it into several"


def require_packed_file(file: Path) -> None:
    """InputError where a file that is compressed as a whole unpacks to more than its size makes plausible, or to an
    MCAP file whose chunks do. It is unpacked into a temporary file to check the latter."""
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
    """InputError where messages that are compressed one by one unpack to more than the file's size makes plausible."""
    if file.suffix.lower() != ".db3":
        raise InputError(
            f"{file}: messages packed one by one in a file that is not SQLite's are not read",
            "record the bag again by `ros2 bag record --compression-mode file`, or without compression",
        )
    left = allowed = _allowed(file)
    with decoding(str(file), "a packed ROS 2 bag"):
        for message in _messages(file):
            left -= unpacked_size(io.BytesIO(message), len(message), "zstd", left)
            _require(allowed - left, allowed, file)


def _messages(file: Path) -> Iterator[bytes]:
    with closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as connection:
        for (message,) in connection.execute("SELECT data FROM messages"):
            if isinstance(message, bytes):
                yield message


def _allowed(file: Path) -> int:
    return min(LARGEST_FILE, max(ALWAYS_ALLOWED, LARGEST_EXPANSION * file.stat().st_size))


def _require(size: int, allowed: int, file: Path) -> None:
    if size > allowed:
        raise InputError(
            f"{file}: {file.stat().st_size:,} bytes that unpack to more than {allowed:,}", SMALLER
        )
