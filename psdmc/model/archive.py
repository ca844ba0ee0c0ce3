"""Reader for the arrays of an untrusted .npz file. It checks sizes before it allocates memory, and unpickles nothing."""

from __future__ import annotations

import io
import math
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

BEGINS = b"PK"
"""First bytes of an archive."""
ALWAYS_ALLOWED = 64 << 20
"""Bytes that every file may unpack to."""
LARGEST = 2 << 30
"""Bytes that no file may have, or unpack to."""
LARGEST_RATIO = 200
"""Bytes unpacked per byte of the file, beyond ALWAYS_ALLOWED; models have 10 to 40, zip's own limit is 1032."""

_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    KeyError,
    NotImplementedError,
    RuntimeError,
    OverflowError,
    SyntaxError,
    tokenize.TokenError,
    UnicodeDecodeError,
    Warning,
)
"""Exceptions of zipfile and NumPy's header parser on altered bytes, found by altering every byte of a file."""


class BrokenArchiveError(ValueError):
    """The file begins like a zip archive, but is damaged."""


def opened(data: bytes) -> zipfile.ZipFile:
    """Return the archive in the bytes of a file, ready for reading. Raises ValueError if the bytes are no archive, and
    BrokenArchiveError if the archive is damaged."""
    if not data.startswith(BEGINS):
        raise ValueError("no zip archive")
    try:
        return zipfile.ZipFile(io.BytesIO(data))
    except (*_BROKEN, ValueError, OSError) as error:
        raise BrokenArchiveError(str(error)) from error


def read_arrays(archive: zipfile.ZipFile, names: Iterable[str], size: int) -> dict[str, NDArray[Any]]:
    """Return the named arrays of an archive in a file of `size` bytes.

    Raises ValueError if an array is missing, is larger than a file of that size can hold, or contains Python objects.
    Raises BrokenArchiveError if an array cannot be unpacked.
    """
    members = {info.filename: info for info in archive.infolist()}
    wanted = {name: members.get(f"{name}.npy") for name in names}
    missing = [name for name, info in wanted.items() if info is None]
    if missing:
        raise ValueError(f"no {', '.join(missing)}")
    total = sum(info.file_size for info in wanted.values() if info is not None)
    if total > min(LARGEST, max(ALWAYS_ALLOWED, LARGEST_RATIO * size)):
        raise ValueError(f"{size} bytes that would unpack to {total}")
    return {name: _array(archive, info) for name, info in wanted.items() if info is not None}


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{info.filename}: compressed in another way than NumPy's")
    try:
        content = archive.read(info)
        shape, is_fortran, dtype, start = _header(content)
    except (*_BROKEN, ValueError, TypeError, OSError) as error:
        raise BrokenArchiveError(f"{info.filename}: {error}") from error
    if dtype.hasobject or is_fortran or min(shape, default=0) < 0:
        raise ValueError(f"{info.filename}: no plain array")
    if math.prod(shape) * dtype.itemsize != len(content) - start:
        raise ValueError(f"{info.filename}: {len(content) - start} bytes for shape {shape} of {dtype}")
    return np.ndarray(shape, dtype, content, start)


def _header(content: bytes) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Shape, whether it is stored column by column, type, and the position of the data; NumPy's parser evaluates
    literals only."""
    stream = io.BytesIO(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if np.lib.format.read_magic(stream) != (1, 0):
            raise ValueError("another version than psdmc's")
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    return shape, is_fortran, dtype, stream.tell()
