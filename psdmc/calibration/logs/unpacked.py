"""The unpacked size of a packed stretch of a file, found piece by piece without keeping any.

The size that a packed file states is a claim, and readers that allocate memory for whatever comes out would trust it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, BinaryIO

from psdmc.errors import InputError

PIECE = 2**20
"""Bytes packed or unpacked at once."""


def unpacked_size(file: BinaryIO, packed: int, packing: str, most: int, keep: BinaryIO | None = None) -> int:
    """Bytes that the next `packed` bytes of a file unpack to; counting stops beyond `most`.

    keep     where they are written, if anywhere
    packing  'lz4' or 'zstd'; for any other, 0
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
            "packed ROS 2 bags need lz4 and backports.zstd", "pip install 'psdmc[calibrate]'"
        ) from error
    return {"lz4": LZ4FrameDecompressor, "zstd": ZstdDecompressor}
