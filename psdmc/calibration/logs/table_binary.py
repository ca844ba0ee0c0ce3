"""Tables in npz and Parquet files: named columns of numbers, sizes checked before anything is unpacked."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import decoding
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.table_limits import LARGEST_COLUMNS, require_names, require_size, require_unpacked
from psdmc.calibration.logs.wording import quoted
from psdmc.errors import InputError

NUMBERS = "fiu"
"""Kinds of NumPy's types that are numbers: floating point, signed, unsigned."""


def columns_from_npz(file: BinaryIO, name: str) -> dict[str, Array]:
    """Named columns of an npz file: one array of one dimension each."""
    with decoding(name, "an npz file"), zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        require_size(0, len(members), 0, name)
        require_unpacked(sum(member.file_size for member in members), _size(file), name)
        names = [member.filename.removesuffix(".npy") for member in members]
        require_names(names, name)
        stored = [array_of(archive.read(member)) for member in members]
        return {column: _column(values, column, name) for column, values in zip(names, stored, strict=True)}


def array_of(content: bytes) -> Any:
    """A member's array; ValueError where its header names more numbers than follow, for which NumPy would allocate
    memory."""
    stream = io.BytesIO(content)
    is_first = np.lib.format.read_magic(stream) == (1, 0)
    read_header = np.lib.format.read_array_header_1_0 if is_first else np.lib.format.read_array_header_2_0
    shape, _, dtype = read_header(stream)
    claimed, found = math.prod(shape) * dtype.itemsize, len(content) - stream.tell()
    if claimed > found:
        raise ValueError(f"an array of {claimed:,} bytes, of which {found:,} are there")
    return np.lib.format.read_array(io.BytesIO(content))


def npz_names(file: BinaryIO, name: str) -> tuple[str, ...]:
    """The columns' names."""
    with decoding(name, "an npz file"), zipfile.ZipFile(file) as archive:
        return tuple(member.removesuffix(".npy") for member in archive.namelist()[: LARGEST_COLUMNS + 1])


def _column(values: Any, column: str, name: str) -> Array:
    if not isinstance(values, np.ndarray) or values.ndim != 1:
        raise InputError(
            f"{name}: {quoted(column)} has {np.ndim(values)} dimensions, expected one column of numbers",
            "a log in npz form has one array per column: time_s, position_rad.<joint>, ...",
        )
    if values.dtype.kind not in NUMBERS:
        raise InputError(
            f"{name}: column {quoted(column)} holds {values.dtype}, expected numbers",
            "write the column as numbers",
        )
    return np.asarray(values, dtype=np.float64)


def _size(file: BinaryIO) -> int:
    return file.seek(0, io.SEEK_END)


def write_npz(columns: Mapping[str, Array], path: Path) -> None:
    """Write named columns as an npz file."""
    with path.open("wb") as file:
        np.savez(file, **dict(columns))  # type: ignore[arg-type]


def open_parquet(file: BinaryIO, name: str) -> tuple[Any, list[str]]:
    """pyarrow's file and its column names; InputError where columns hold anything but numbers."""
    parquet = parquet_module()
    with decoding(name, "a Parquet file"):
        stored = parquet.ParquetFile(file, pre_buffer=False)
        fields = list(stored.schema_arrow)
        require_names([field.name for field in fields], name)
        for field in fields:
            _require_numbers(field, name)
        return stored, [field.name for field in fields]


def columns_from_parquet(file: BinaryIO, name: str) -> dict[str, Array]:
    """Named columns of a Parquet file; a missing value (null) is NaN."""
    size = _size(file)
    stored, _ = open_parquet(file, name)
    with decoding(name, "a Parquet file"):
        require_size(stored.metadata.num_rows, stored.metadata.num_columns, size, name)
        fields = list(stored.schema_arrow)
        table = stored.read(use_threads=False)
        return {
            field.name: np.asarray(table.column(k).to_numpy(), dtype=np.float64)
            for k, field in enumerate(fields)
        }


def parquet_names(file: BinaryIO, name: str) -> tuple[str, ...]:
    """The columns' names."""
    parquet = parquet_module()
    with decoding(name, "a Parquet file"):
        return tuple(parquet.ParquetFile(file).schema_arrow.names)


def _require_numbers(field: Any, name: str) -> None:
    from pyarrow import types

    if not (types.is_floating(field.type) or types.is_integer(field.type)):
        raise InputError(
            f"{name}: column {quoted(field.name)} holds {field.type}, expected numbers",
            "leave it out of the log",
        )


def write_parquet(columns: Mapping[str, Array], path: Path) -> None:
    """Write named columns as a Parquet file."""
    import pyarrow

    parquet_module().write_table(pyarrow.table(dict(columns)), path)


def parquet_module() -> Any:
    """pyarrow's module for Parquet; InputError where it is not installed."""
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise InputError("Parquet logs need pyarrow", "pip install 'psdmc[calibrate]'") from error
    return pyarrow.parquet
