"""Tables in pieces: the names of their columns, then rows one piece after the other, so that no table is held as a
whole."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import IO, Any, BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import decoding
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.table_binary import NUMBERS, open_parquet
from psdmc.calibration.logs.table_csv import CsvReader
from psdmc.calibration.logs.table_limits import require_names
from psdmc.calibration.logs.table_text import PIECE_BYTES, whole_lines
from psdmc.calibration.logs.wording import quoted
from psdmc.errors import InputError

PIECE_ROWS = 65_536
"""Of binary tables."""

Pieces = tuple[list[str], Iterator[Array]]


def csv_pieces(file: BinaryIO, name: str) -> Pieces:
    """Of a CSV file: each piece ends with a line."""
    reader = CsvReader(name)
    names = reader.header(file.readline(PIECE_BYTES))
    while not names:  # empty lines before the header
        line = file.readline(PIECE_BYTES)
        names = reader.header(line) if line else reader.no_header()
    return names, (rows for text in whole_lines(file, name) if len(rows := reader.rows(text)))


def parquet_pieces(file: BinaryIO, name: str) -> Pieces:
    """Of a Parquet file; a missing value (null) is NaN."""
    stored, names = open_parquet(file, name)
    return names, _batches(stored, name)


def _batches(stored: Any, name: str) -> Iterator[Array]:
    with decoding(name, "a Parquet file"):
        for batch in stored.iter_batches(batch_size=PIECE_ROWS, use_threads=False):
            yield np.column_stack(
                [
                    np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
                    for column in batch.columns
                ]
            )


def npz_pieces(file: BinaryIO, name: str) -> Pieces:
    """Of an npz file: all columns are read side by side."""
    with decoding(name, "an npz file"):
        archive = zipfile.ZipFile(file)
        members = archive.infolist()
    names = [member.filename.removesuffix(".npy") for member in members]
    require_names(names, name)
    return names, _side_by_side(archive, names, name)


def _side_by_side(archive: zipfile.ZipFile, names: list[str], name: str) -> Iterator[Array]:
    with decoding(name, "an npz file"), ExitStack() as stack:
        streams = [stack.enter_context(archive.open(member)) for member in archive.infolist()]
        heads = [_head(stream, column, name) for stream, column in zip(streams, names, strict=True)]
        counts = {column: count for column, (count, _) in zip(names, heads, strict=True)}
        odd = [f"{quoted(column)} has {count}" for column, count in counts.items() if count != heads[0][0]]
        if odd:
            raise InputError(
                f"{name}: column {quoted(names[0])} has {heads[0][0]} rows, but {odd[0]}",
                "all columns have one value per row",
            )
        for start in range(0, heads[0][0], PIECE_ROWS):
            rows = min(PIECE_ROWS, heads[0][0] - start)
            yield np.column_stack(
                [_numbers(stream, rows, dtype) for stream, (_, dtype) in zip(streams, heads, strict=True)]
            )


def _head(stream: IO[bytes], column: str, name: str) -> tuple[int, np.dtype[Any]]:
    """How many numbers a column holds, and of which type."""
    is_first = np.lib.format.read_magic(stream) == (1, 0)
    read = np.lib.format.read_array_header_1_0 if is_first else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    if len(shape) != 1 or dtype.kind not in NUMBERS:
        raise InputError(
            f"{name}: {quoted(column)} holds {dtype} in {len(shape)} dimensions, expected one column of numbers",
            "a log in npz form has one array per column: time_s, position_rad.<joint>, ...",
        )
    return shape[0], dtype


def _numbers(stream: IO[bytes], count: int, dtype: np.dtype[Any]) -> Array:
    content = stream.read(count * dtype.itemsize)
    return np.frombuffer(content, dtype=dtype, count=count).astype(np.float64)


PIECES: dict[str, Callable[[BinaryIO, str], Pieces]] = {
    ".csv": csv_pieces,
    ".parquet": parquet_pieces,
    ".npz": npz_pieces,
}
"""By a file's ending."""
