"""Reads NumPy's npz files with one array per column. If a log description names the columns, an array may also have
several columns."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import (
    decoding,
    quoted,
    require_names,
    require_size,
    require_unpacked,
)
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_format import (
    NUMBERS,
    PIECE_ROWS,
    Columns,
    Pieces,
    TableFormat,
    TextForm,
    refuse_dates,
    require_equal,
)
from psdmc.errors import InputError

ONE_COLUMN = "a log in npz form has one array per column: time_s, position_rad.<joint>, ..."


class NpzFormat(TableFormat):
    endings = (".npz",)

    def columns_of(self, file: BinaryIO, name: str, form: TextForm) -> Columns:
        """Return the columns of an npz file by name.

        An array of one dimension is one column. Column k (from 1) of an array with two dimensions has the name NAME[k].
        """
        with decoding(name, "an npz file"), zipfile.ZipFile(file) as archive:
            members = _members(archive, file, name)
            arrays = {_column(m): _array(archive.read(m)) for m in members}
        return columns_of_arrays(arrays, name)

    def pieces(self, file: BinaryIO, name: str) -> Pieces:
        """Return the column names of an npz file, and its rows as a sequence of parts.

        All columns are read in parallel, so that only one part is in memory at a time.
        """
        with decoding(name, "an npz file"):
            archive = zipfile.ZipFile(file)
            members = _members(archive, file, name)
        names = [_column(member) for member in members]
        require_names(names, name)
        return names, _side_by_side(archive, members, name)

    def write(self, columns: Mapping[str, Array], path: Path) -> None:
        with path.open("wb") as file:
            np.savez(file, **dict(columns))  # type: ignore[arg-type]


def columns_of_arrays(arrays: Mapping[str, Any], name: str) -> Columns:
    """Return columns by name from arrays in memory: NAME, or NAME[k] for column k (from 1) of an array with two
    dimensions. Other arrays are left out."""
    found: dict[str, Array] = {}
    for key, values in arrays.items():
        if values.dtype.kind not in NUMBERS or values.ndim not in (1, 2):
            continue
        if values.ndim == 1:
            found[key] = values
        else:
            require_size(len(values), values.shape[1], 8 * values.size, name)
            found |= {f"{key}[{k + 1}]": values[:, k] for k in range(values.shape[1])}

    def rows(places: Sequence[int], dates: bool) -> Iterator[Array]:
        refuse_dates(dates, name)
        names, values = list(found), list(found.values())
        require_equal({names[k]: len(values[k]) for k in places}, name)
        wanted = [values[k] for k in places]
        yield np.column_stack(wanted).astype(np.float64) if wanted else np.empty((0, 0))

    return Columns(name, tuple(found), len(found), rows)


def _members(archive: zipfile.ZipFile, file: BinaryIO, name: str) -> list[zipfile.ZipInfo]:
    members = archive.infolist()
    require_size(0, len(members), 0, name)
    require_unpacked(sum(member.file_size for member in members), file.seek(0, io.SEEK_END), name)
    return members


def _column(member: zipfile.ZipInfo) -> str:
    return member.filename.removesuffix(".npy")


def _array(content: bytes) -> Any:
    _head(io.BytesIO(content), len(content))
    return np.lib.format.read_array(io.BytesIO(content))


def _head(stream: IO[bytes], size: int) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of a member's array; ValueError if its header claims more numbers than follow."""
    is_first = np.lib.format.read_magic(stream) == (1, 0)
    read = np.lib.format.read_array_header_1_0 if is_first else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    claimed, found = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if claimed > found:
        raise ValueError(f"an array of {claimed:,} bytes, of which {found:,} are there")
    return shape, dtype


def _side_by_side(archive: zipfile.ZipFile, members: Sequence[zipfile.ZipInfo], name: str) -> Iterator[Array]:
    with decoding(name, "an npz file"), ExitStack() as stack:
        streams = [stack.enter_context(archive.open(member)) for member in members]
        heads = [_head(stream, member.file_size) for stream, member in zip(streams, members, strict=True)]
        for member, (shape, dtype) in zip(members, heads, strict=True):
            _require_column(_column(member), shape, dtype, name)
        require_equal({_column(m): shape[0] for m, (shape, _) in zip(members, heads, strict=True)}, name)
        for start in range(0, heads[0][0][0] if heads else 0, PIECE_ROWS):
            count = min(PIECE_ROWS, heads[0][0][0] - start)
            yield np.column_stack(
                [_numbers(stream, count, dtype) for stream, (_, dtype) in zip(streams, heads, strict=True)]
            )


def _require_column(column: str, shape: tuple[int, ...], dtype: np.dtype[Any], name: str) -> None:
    if len(shape) != 1:
        raise InputError(
            f"{name}: {quoted(column)} has {len(shape)} dimensions, expected one column of numbers",
            ONE_COLUMN,
        )
    if dtype.kind not in NUMBERS:
        raise InputError(
            f"{name}: column {quoted(column)} holds {dtype}, expected numbers", "write the column as numbers"
        )


def _numbers(stream: IO[bytes], count: int, dtype: np.dtype[Any]) -> Array:
    content = stream.read(count * dtype.itemsize)
    return np.frombuffer(content, dtype=dtype, count=count).astype(np.float64)


FORMAT = NpzFormat()
