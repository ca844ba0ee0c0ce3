"""Binary logs: Parquet tables with other columns, SQLite files with other cells, and their bytes."""

from __future__ import annotations

import io
import sqlite3
from random import Random
from typing import Any

from mutate_bytes import mutate_bytes
from nasty import anything, number, text

SUFFIX_TYPES = (
    "float64",
    "float32",
    "float16",
    "int64",
    "uint8",
    "bool",
    "string",
    "null",
    "decimal",
    "time",
    "list",
    "struct",
    "category",
    "bytes",
)


def mutate_parquet(data: bytes, rng: Random) -> bytes:
    """Columns retyped, renamed, repeated, dropped or emptied."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if rng.random() < 0.3:
        return mutate_bytes(data, rng)
    try:
        table = pq.read_table(io.BytesIO(data))
        names, columns = (
            list(table.column_names),
            [table.column(k).combine_chunks() for k in range(table.num_columns)],
        )
        _edit_columns(names, columns, rng, pa)
        stream = io.BytesIO()
        pq.write_table(pa.Table.from_arrays(columns, names=names), stream)
        return stream.getvalue()
    except Exception:
        return mutate_bytes(data, rng)


def _edit_columns(names: list[str], columns: list[Any], rng: Random, pa: Any) -> None:
    for _ in range(rng.choice((1, 1, 2))):
        at = rng.randrange(len(names))
        choice = rng.randrange(5)
        if choice == 0:
            names[at] = rng.choice((text(rng), names[rng.randrange(len(names))]))
        elif choice == 1:
            del names[at], columns[at]
        elif choice == 2:
            columns[:] = [column[: rng.choice((0, 1, 2))] for column in columns]
        else:
            columns[at] = _retyped(columns[at], rng, pa)


def _retyped(column: Any, rng: Random, pa: Any) -> Any:
    kind, values = rng.choice(SUFFIX_TYPES), column.to_pylist()
    if kind == "list":
        return pa.array([[v] for v in values])
    if kind == "struct":
        return pa.array([{"a": v} for v in values])
    if kind == "category":
        return pa.array([str(v) for v in values]).dictionary_encode()
    if kind == "bytes":
        return pa.array([repr(v).encode() for v in values])
    if kind == "string":
        return pa.array([number(rng) for _ in values])
    if kind == "null":
        return pa.array([v if rng.random() < 0.5 else None for v in values])
    if kind == "time":
        return pa.array([int(v) for v in values]).cast(
            rng.choice((pa.timestamp("ns"), pa.date64(), pa.duration("s")))
        )
    if kind == "decimal":
        return column.cast(pa.decimal128(38, 10))
    return column.cast(kind, safe=False)


def mutate_sqlite(data: bytes, rng: Random) -> bytes:
    """A bag's cells: message bytes, topics' names and types, tables and columns."""
    if rng.random() < 0.3:
        return mutate_bytes(data, rng)
    connection = sqlite3.connect(":memory:")
    try:
        connection.deserialize(data)
        rng.choice((_message, _message, _message, _topic, _table))(connection, rng)
        connection.commit()
        return connection.serialize()
    except Exception:
        return mutate_bytes(data, rng)
    finally:
        connection.close()


def _message(connection: sqlite3.Connection, rng: Random) -> None:
    rows = connection.execute("SELECT id, data FROM messages").fetchall()
    key, raw = rng.choice(rows)
    other: Any = rng.choice(
        (
            mutate_bytes(bytes(raw), rng),
            mutate_bytes(bytes(raw), rng),
            b"",
            None,
            7,
            "text",
            bytes(raw)[: rng.randrange(9)],
        )
    )
    where, values = rng.choice((("WHERE id = ?", (other, key)), ("", (other,))))
    connection.execute(f"UPDATE messages SET data = ? {where}", values)


def _topic(connection: sqlite3.Connection, rng: Random) -> None:
    column = rng.choice(("name", "type", "serialization_format", "id"))
    value = rng.choice((text(rng), anything(rng), "std_msgs/msg/String", "/joint_states"))
    connection.execute(f"UPDATE topics SET {column} = ?", (value,))


def _table(connection: sqlite3.Connection, rng: Random) -> None:
    connection.execute(
        rng.choice(
            (
                "DROP TABLE messages",
                "DROP TABLE topics",
                "DELETE FROM messages",
                "DELETE FROM topics",
                "INSERT INTO topics SELECT id + 1, name, type, serialization_format, offered_qos_profiles FROM topics",
                "ALTER TABLE messages RENAME COLUMN data TO datum",
                "ALTER TABLE topics RENAME COLUMN type TO kind",
                "UPDATE messages SET timestamp = 'soon'",
                "UPDATE messages SET topic_id = 99",
            )
        )
    )
