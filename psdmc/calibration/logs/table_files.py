"""Tables of named columns as .csv, .parquet or .npz files: read with faults named, written completely or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from psdmc.atomic import make_folder, whole_file
from psdmc.calibration.logs.foreign_bytes import LARGEST_FILE, SHORTER, opened
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.table_binary import (
    columns_from_npz,
    columns_from_parquet,
    npz_names,
    parquet_names,
    write_npz,
    write_parquet,
)
from psdmc.calibration.logs.table_csv import columns_from_csv, header_names
from psdmc.calibration.logs.table_limits import require_size
from psdmc.calibration.logs.wording import listed, quoted
from psdmc.errors import InputError
from psdmc.reading import read_rest

TABLES = (".csv", ".parquet", ".npz")
LARGEST_HEADER = 1024**2
"""Bytes of a CSV file's first line: a thousand columns with names of a thousand letters."""


def read_columns(path: Path) -> dict[str, Array]:
    """Named columns of equal length of a .csv, .npz or .parquet file.

    InputError where the file is missing, unreadable, too large, damaged, or holds anything but numbers.
    """
    kind = _kind(path)
    with opened(path) as file:
        if kind == ".csv":
            columns = columns_from_csv(read_rest(file, LARGEST_FILE, str(path), SHORTER), str(path))
        else:
            reader = columns_from_npz if kind == ".npz" else columns_from_parquet
            columns = reader(file, str(path))
    _require_equal(columns, str(path))
    return columns


def column_names(path: Path) -> tuple[str, ...]:
    """The names of a table's columns, without reading it all."""
    kind = _kind(path)
    with opened(path) as file:
        if kind == ".csv":
            return header_names(file.readline(LARGEST_HEADER), str(path))
        return (npz_names if kind == ".npz" else parquet_names)(file, str(path))


def _kind(path: Path) -> str:
    kind = path.suffix.lower()
    if kind not in TABLES:
        raise InputError(f"{path}: '{path.suffix}' is no table", f"known are {', '.join(TABLES)}")
    return kind


def _require_equal(columns: Mapping[str, Array], name: str) -> None:
    if not columns:
        raise InputError(f"{name}: holds no columns", "record or export it again")
    lengths = {column: len(values) for column, values in columns.items()}
    first = next(iter(lengths))
    odd = [f"{quoted(column)} has {count}" for column, count in lengths.items() if count != lengths[first]]
    if odd:
        raise InputError(
            f"{name}: column {quoted(first)} has {lengths[first]} rows, but {listed(odd)}",
            "all columns have one value per row",
        )
    require_size(lengths[first], len(columns), 8 * lengths[first] * len(columns), name)


def write_columns(columns: Mapping[str, Array], path: Path) -> None:
    """Write named columns of equal length as .csv, .parquet or .npz; a reader never sees a part of a file."""
    kind = _kind(path)
    write = {".csv": _write_csv, ".npz": write_npz, ".parquet": write_parquet}[kind]
    make_folder(path.parent)
    with whole_file(path) as own:
        write(columns, own)


def _write_csv(columns: Mapping[str, Array], path: Path) -> None:
    header = ",".join(_cell(column) for column in columns)
    np.savetxt(
        path,
        np.column_stack(list(columns.values())),
        "%.17g",
        ",",
        header=header,
        comments="",
        encoding="utf-8",
    )


def _cell(name: str) -> str:
    """A name as a CSV cell: quoted where it would not be one cell otherwise."""
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',;"\t') else name
