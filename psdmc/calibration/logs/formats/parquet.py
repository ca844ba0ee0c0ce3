"""Reads Parquet files through pyarrow. A missing value (null) becomes NaN."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import decoding, quoted, require_names, require_size
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_format import PIECE_ROWS, Columns, Pieces, TableFormat, TextForm, refuse_dates
from psdmc.errors import InputError


class ParquetFormat(TableFormat):
    endings = (".parquet",)

    def columns_of(self, file: BinaryIO, name: str, form: TextForm) -> Columns:
        """Return all columns by name. A column that is not numeric gives an error only when it is read."""
        stored, fields = _opened(file, name)
        require_size(0, len(fields), 0, name)

        def rows(places: Sequence[int], dates: bool) -> Iterator[Array]:
            chosen = [fields[k] for k in places]
            if dates and not _is_timestamp(chosen[0]):
                refuse_dates(dates, name)
            _require_numbers(chosen[1:] if dates else chosen, name, "name another column")
            with decoding(name, "a Parquet file"):
                wanted = [field.name for field in chosen]
                for batch in stored.iter_batches(batch_size=PIECE_ROWS, columns=wanted, use_threads=False):
                    columns = [batch.column(one) for one in wanted]
                    first = [_seconds(columns.pop(0))] if dates else []
                    yield np.column_stack([*first, *(_numbers(column) for column in columns)])

        return Columns(name, tuple(field.name for field in fields), len(fields), rows)

    def pieces(self, file: BinaryIO, name: str) -> Pieces:
        stored, fields = _opened(file, name)
        names = [field.name for field in fields]
        require_names(names, name)
        _require_numbers(fields, name, "leave it out of the log")
        return names, _batches(stored, name)

    def write(self, columns: Mapping[str, Array], path: Path) -> None:
        _parquet().write_table(_arrow().table(dict(columns)), path)


def _opened(file: BinaryIO, name: str) -> tuple[Any, list[Any]]:
    """pyarrow's file, and its fields."""
    parquet = _parquet()
    with decoding(name, "a Parquet file"):
        stored = parquet.ParquetFile(file, pre_buffer=False)
        return stored, list(stored.schema_arrow)


def _batches(stored: Any, name: str) -> Iterator[Array]:
    with decoding(name, "a Parquet file"):
        for batch in stored.iter_batches(batch_size=PIECE_ROWS, use_threads=False):
            yield np.column_stack([_numbers(column) for column in batch.columns])


def _numbers(column: Any) -> Array:
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _seconds(column: Any) -> Array:
    """s since 1970 of time stamps."""
    stamps = np.asarray(column.to_numpy(zero_copy_only=False)).astype("datetime64[ns]")
    return np.asarray((stamps - np.datetime64(0, "ns")) / np.timedelta64(1, "s"), dtype=np.float64)


def _is_timestamp(field: Any) -> bool:
    return bool(_arrow().types.is_timestamp(field.type))


def _require_numbers(fields: Sequence[Any], name: str, hint: str) -> None:
    types = _arrow().types
    for field in fields:
        if not (types.is_floating(field.type) or types.is_integer(field.type)):
            raise InputError(
                f"{name}: column {quoted(field.name)} holds {field.type}, expected numbers", hint
            )


def _arrow() -> Any:
    try:
        import pyarrow
    except ImportError as error:
        raise InputError("Parquet logs need pyarrow", "pip install 'psdmc[calibrate]'") from error
    return pyarrow


def _parquet() -> Any:
    _arrow()
    import pyarrow.parquet

    return pyarrow.parquet


FORMAT = ParquetFormat()
