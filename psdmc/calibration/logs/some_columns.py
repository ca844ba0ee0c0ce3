"""Columns by place from log files of any kind, whatever their other columns are called or hold."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import LARGEST_STORED, decoding, opened
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_bag import BAGS, is_bag, read_bag
from psdmc.calibration.logs.row_store import HELD_BYTES
from psdmc.calibration.logs.table_binary import NUMBERS, array_of, parquet_module
from psdmc.calibration.logs.table_limits import require_size, require_unpacked
from psdmc.calibration.logs.table_pieces import PIECE_ROWS
from psdmc.calibration.logs.table_text import TextForm, TextTable
from psdmc.calibration.logs.wording import quoted
from psdmc.errors import InputError

TEXTS = (".csv", ".txt", ".tsv", ".dat", ".log")
BINARY = (".npz", ".parquet")


@dataclass(frozen=True, slots=True)
class Columns:
    """An open log file's columns.

    name   for messages
    names  of its columns; empty where a text table has no header
    width  number of columns
    rows   (k, len(places)) of columns by place (from 0), in pieces; may be called once. Where its second argument is true,
           the first column holds dates, which become s since 1970
    """

    name: str
    names: tuple[str, ...]
    width: int
    rows: Callable[[Sequence[int], bool], Iterator[Array]]


@contextmanager
def open_columns(path: Path, form: TextForm, topic: str = "", held: int = HELD_BYTES) -> Iterator[Columns]:
    """The columns of a text table, .npz, .parquet or ROS 2 bag; InputError where it is missing, damaged or none of these.

    form   of a text table;  topic  of a bag, empty: its only one
    held   bytes of a bag's rows in memory; more go to a temporary file
    """
    kind = path.suffix.lower()
    if is_bag(path):
        yield _of_bag(path, topic, held)
        return
    if topic:
        raise InputError(f"{path}: topic {quoted(topic)}, but it is no bag", "leave the topic out")
    if kind not in (*TEXTS, *BINARY):
        known = ", ".join((*TEXTS, *BINARY, *BAGS))
        raise InputError(f"{path}: '{path.suffix}' is no log format", f"known are {known}")
    with opened(path, LARGEST_STORED) as file:
        if kind in TEXTS:
            table = TextTable(file, str(path), form)
            yield Columns(str(path), table.names, table.width, table.rows)
        else:
            yield (_of_npz if kind == ".npz" else _of_parquet)(file, str(path))


def _of_bag(path: Path, topic: str, held: int) -> Columns:
    """Of joint states: time_s, then position.<joint>, velocity.<joint> where all have one, effort.<joint>."""
    log = read_bag(path, topic, held=held)
    parts = ("position", "velocity", "effort") if log.has_velocity else ("position", "effort")
    names = ("time_s", *(f"{part}.{joint}" for part in parts for joint in log.joint_names))

    def rows(places: Sequence[int], dates: bool) -> Iterator[Array]:
        _refuse_dates(dates, str(path))
        for start in range(0, len(log), PIECE_ROWS):
            own = log.rows(start, min(start + PIECE_ROWS, len(log)))
            velocity = () if own.velocity is None else (own.velocity,)
            whole = np.column_stack([own.time, own.position, *velocity, own.effort])
            yield whole[:, list(places)]

    return Columns(str(path), names, len(names), rows)


def _of_npz(file: BinaryIO, name: str) -> Columns:
    """Arrays of one dimension by name; column k of one with two dimensions is NAME[k], k from 1."""
    with decoding(name, "an npz file"), zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        require_size(0, len(members), 0, name)
        require_unpacked(sum(member.file_size for member in members), file.seek(0, 2), name)
        arrays = {m.filename.removesuffix(".npy"): array_of(archive.read(m)) for m in members}
    found: dict[str, Array] = {}
    for key, values in arrays.items():
        if values.dtype.kind not in NUMBERS or values.ndim not in (1, 2):
            continue
        if values.ndim == 1:
            found[key] = values
        else:
            require_size(len(values), values.shape[1], 8 * values.size, name)
            found |= {f"{key}[{k + 1}]": values[:, k] for k in range(values.shape[1])}
    columns = list(found.values())

    def rows(places: Sequence[int], dates: bool) -> Iterator[Array]:
        _refuse_dates(dates, name)
        chosen = [columns[k] for k in places]
        lengths = {len(column) for column in chosen}
        if len(lengths) > 1:
            names = [quoted(list(found)[k]) for k in places]
            first = next(k for k, column in enumerate(chosen) if len(column) != len(chosen[0]))
            raise InputError(
                f"{name}: {names[0]} has {len(chosen[0])} rows, but {names[first]} has {len(chosen[first])}",
                "all columns have one value per row",
            )
        yield np.column_stack(chosen).astype(np.float64)

    return Columns(name, tuple(found), len(found), rows)


def _of_parquet(file: BinaryIO, name: str) -> Columns:
    """Columns of numbers; others are named, and refused when they are asked for."""
    from pyarrow import types

    with decoding(name, "a Parquet file"):
        stored = parquet_module().ParquetFile(file, pre_buffer=False)
        fields = list(stored.schema_arrow)
        require_size(0, len(fields), 0, name)

    def rows(places: Sequence[int], dates: bool) -> Iterator[Array]:
        if dates and not types.is_timestamp(fields[places[0]].type):
            _refuse_dates(dates, name)
        numeric = places[1:] if dates else places
        odd = [fields[k] for k in numeric if not _is_numeric(types, fields[k].type)]
        if odd:
            raise InputError(
                f"{name}: column {quoted(odd[0].name)} holds {odd[0].type}, expected numbers",
                "name another column",
            )
        wanted = [fields[k].name for k in places]
        with decoding(name, "a Parquet file"):
            for batch in stored.iter_batches(batch_size=PIECE_ROWS, columns=wanted, use_threads=False):
                yield np.column_stack(
                    [
                        _seconds(batch.column(one)) if dates and k == 0 else _numbers(batch.column(one))
                        for k, one in enumerate(wanted)
                    ]
                )

    return Columns(name, tuple(field.name for field in fields), len(fields), rows)


def _numbers(column: Any) -> Array:
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _seconds(column: Any) -> Array:
    """s since 1970 of time stamps."""
    stamps = np.asarray(column.to_numpy(zero_copy_only=False)).astype("datetime64[ns]")
    return np.asarray((stamps - np.datetime64(0, "ns")) / np.timedelta64(1, "s"), dtype=np.float64)


def _refuse_dates(dates: bool, name: str) -> None:
    if dates:
        raise InputError(f"{name}: its time holds no dates", "write s, ms, us or ns as the unit of [time]")


def _is_numeric(types: Any, kind: Any) -> bool:
    return bool(types.is_floating(kind) or types.is_integer(kind))
