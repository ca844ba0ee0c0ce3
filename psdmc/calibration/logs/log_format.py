"""Base classes of log file formats: they recognise files, list columns, and read rows in pieces. A format is one of
tables or one of ROS bags, of which the messages of type sensor_msgs/JointState on one topic are read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import (
    LARGEST_COLUMNS,
    LARGEST_ROWS,
    LARGEST_STORED,
    LARGEST_STORED_ROWS,
    LARGEST_VALUES,
    decoding,
    listed,
    opened,
    quoted,
)
from psdmc.calibration.logs.log import HELD_BYTES, AnyLog, Array, RowStore, StoredLog, date_of
from psdmc.errors import InputError, InternalError

PIECE_ROWS = 65_536
"""Rows that are read at once from a binary table."""
NUMBERS = "fiu"
"""Kinds of NumPy's types that are numbers: floating point, signed, unsigned."""

Pieces = tuple[list[str], Iterator[Array]]
"""The names of a table's columns, and its rows, (k, columns) a piece."""


@dataclass(frozen=True, slots=True)
class TextForm:
    """Known properties of a text table such as CSV, before reading the table.

    separator  character between cells; None: psdmc determines the character from the first lines
    header     whether the table has a line with column names; None: psdmc determines this from the first lines
    skip       number of lines before the table
    """

    separator: str | None = None
    header: bool | None = None
    skip: int = 0


@dataclass(frozen=True, slots=True)
class Opening:
    """Options for opening a log file, from the user's log description (TOML) and from the memory limit.

    form   known properties of a text table
    topic  topic of a bag; empty: the only topic of the bag
    held   largest size in bytes of a bag's rows in memory; more rows go to a temporary file
    """

    form: TextForm = field(default_factory=TextForm)
    topic: str = ""
    held: int = HELD_BYTES


@dataclass(frozen=True, slots=True)
class Columns:
    """The columns of an open log file, with any names and contents.

    name   name of the file, for messages
    names  names of the columns; empty if a text table has no header
    width  number of columns
    rows   function that yields the numbers in some columns in parts (rows, columns); it may be called once. The first
           argument has the column indices (from 0). If the second argument is true, the first of these columns holds
           dates, which become seconds since 1970
    """

    name: str
    names: tuple[str, ...]
    width: int
    rows: Callable[[Sequence[int], bool], Iterator[Array]]


class LogFormat(ABC):
    """A format of log files: one module of the folder `formats`, with one object called FORMAT.

    endings     suffixes of its files, in lower case, with the dot
    has_topics  whether a file holds several topics, of which one is read
    """

    endings: tuple[str, ...]
    has_topics = False

    def sniff(self, path: Path) -> bool:
        """Return whether this format reads a path."""
        return path.suffix.lower() in self.endings

    def read(self, path: Path, topic: str = "", held: int | None = None) -> AnyLog:
        """Return the log that a file without named columns, such as a bag, holds."""
        raise InternalError(f"{path}: a table, which is read in pieces")

    @abstractmethod
    @contextmanager
    def columns(self, path: Path, opening: Opening) -> Iterator[Columns]:
        """Open a file for a log description. Raises InputError if it is missing, damaged or of another format."""


class TableFormat(LogFormat):
    """A format of tables: `pieces` reads them with psdmc's own column names; `write`, if it can, writes them."""

    @contextmanager
    def columns(self, path: Path, opening: Opening) -> Iterator[Columns]:
        if opening.topic:
            raise InputError(
                f"{path}: topic {quoted(opening.topic)}, but it is no bag", "leave the topic out"
            )
        with opened(path, LARGEST_STORED) as file:
            yield self.columns_of(file, str(path), opening.form)

    @abstractmethod
    def columns_of(self, file: BinaryIO, name: str, form: TextForm) -> Columns:
        """Return the columns of an open file."""

    @abstractmethod
    def pieces(self, file: BinaryIO, name: str) -> Pieces:
        """Return the names and rows of a table of numbers. Raises InputError if a column holds anything else."""

    def write(self, columns: Mapping[str, Array], path: Path) -> None:
        """Write named columns of equal length."""
        raise InputError(f"{path}: psdmc does not write {path.suffix} files", "write .csv, .parquet or .npz")


def refuse_dates(dates: bool, name: str) -> None:
    """Raise InputError if the user asks for dates in a file whose columns are all numbers."""
    if dates:
        raise InputError(f"{name}: its time holds no dates", "write s, ms, us or ns as the unit of [time]")


def require_equal(lengths: Mapping[str, int], name: str) -> None:
    """Raise InputError if the columns, whose lengths are given by name, differ in length."""
    first = next(iter(lengths), "")
    odd = [f"{quoted(column)} has {count}" for column, count in lengths.items() if count != lengths[first]]
    if odd:
        raise InputError(
            f"{name}: column {quoted(first)} has {lengths[first]} rows, but {odd[0]}",
            "all columns have one value per row",
        )


# ROS bags


MESSAGE_TYPE = "sensor_msgs/msg/JointState"
USUAL_TOPIC = "/joint_states"
LARGEST_MESSAGE = 1024**2
"""Bytes of one joint state: a thousand joints."""
PIECE_MESSAGES = 4096
"""Messages held one by one."""


class BagFormat(LogFormat):
    """The base class of bag formats. A subclass finds topics with joint states and reads their messages."""

    has_topics = True
    what: str
    """What a damaged file is not, for messages."""

    @abstractmethod
    def require_sizes(self, path: Path, held: int | None) -> None:
        """Raise InputError if a file is missing or too large, or unpacks to more bytes than is plausible for its size.

        held  largest size in bytes of the rows that stay in memory; None: all rows stay in memory
        """

    @abstractmethod
    def topics(self, path: Path) -> tuple[str, ...]:
        """Return the topics of the bag that contain joint states."""

    @abstractmethod
    def raw_messages(self, path: Path, topic: str) -> Iterator[bytes]:
        """Yield the serialised joint states of a topic in the order of recording."""

    @abstractmethod
    def decoded(self, raw: bytes) -> Any:
        """Return a joint state with the fields of its message type."""

    def read(self, path: Path, topic: str = "", held: int | None = None) -> AnyLog:
        """Return the joint states of one topic as a log.

        Effort is read as motor torque. Times come from the header of each message.

        topic  name of the topic; empty: /joint_states, or the only topic with joint states
        held   largest size in bytes of the rows that stay in memory; None: no limit. The rows of a larger log go to a
               temporary file (StoredLog)

        Raises InputError if the bag is damaged, the topic is missing, or the messages contain different joints.
        """
        self.require_sizes(path, held)
        with decoding(str(path), self.what):
            topic = self._topic(path, topic)
            names, stamps, store, has_velocity = self._kept(path, topic, held)
        name = path.name or str(path)
        n = len(names)
        log = StoredLog(
            name=name,
            joint_names=names,
            time=stamps - stamps[0],
            store=store,
            has_velocity=has_velocity,
            quantity="motor_torque",
            stored=n,
            places=tuple(range(n)),
            notes=(f"{name}: 'effort' is read as motor torque, friction included",),
            date=date_of(float(stamps[0])),
        )
        return log if store.on_disk else log.held()

    @contextmanager
    def columns(self, path: Path, opening: Opening) -> Iterator[Columns]:
        """Return the columns: time_s, then position.<joint>, velocity.<joint> if all have one, effort.<joint>."""
        log = self.read(path, opening.topic, opening.held)
        parts = ("position", "velocity", "effort") if log.has_velocity else ("position", "effort")
        names = ("time_s", *(f"{part}.{joint}" for part in parts for joint in log.joint_names))

        def rows(places: Sequence[int], dates: bool) -> Iterator[Array]:
            refuse_dates(dates, str(path))
            for start in range(0, len(log), PIECE_ROWS):
                own = log.rows(start, min(start + PIECE_ROWS, len(log)))
                velocity = () if own.velocity is None else (own.velocity,)
                whole = np.column_stack([own.time, own.position, *velocity, own.effort])
                yield whole[:, list(places)]

        yield Columns(str(path), names, len(names), rows)

    def _topic(self, path: Path, wanted: str) -> str:
        """The topic to read; InputError where joint states are on none, or on several of other names."""
        found = self.topics(path)
        if wanted in found or (not wanted and USUAL_TOPIC in found):
            return wanted or USUAL_TOPIC
        if not wanted and len(found) == 1:
            return found[0]
        has = f"it has them on {listed([quoted(topic) for topic in found])}" if found else "it has none"
        what = f"on topic {quoted(wanted)}" if wanted else "that could be meant alone"
        hint = (
            "name one: --topic, or topic in a log description"
            if found
            else "record joint states with positions and efforts"
        )
        raise InputError(f"{path}: no {MESSAGE_TYPE} {what}: {has}", hint)

    def _kept(
        self, path: Path, topic: str, held: int | None
    ) -> tuple[tuple[str, ...], Array, RowStore, bool]:
        """Joints, time stamps, rows of position, velocity and effort, and whether all have a velocity."""
        most = LARGEST_ROWS if held is None else LARGEST_STORED_ROWS
        names: tuple[str, ...] = ()
        store, has_velocity = RowStore(0), True
        stamps: list[tuple[int, int]] = []
        piece: list[Array] = []
        for number, raw in enumerate(self.raw_messages(path, topic), start=1):
            if len(raw) > LARGEST_MESSAGE:
                raise InputError(
                    f"{path}: a message of {len(raw):,} bytes, expected at most {LARGEST_MESSAGE:,}",
                    "record the joints' states alone on that topic",
                )
            row = self.decoded(raw)
            if number == 1:
                names = tuple(row.name)
                store = RowStore(3 * len(names), 8 * LARGEST_VALUES if held is None else held)
            _require_alike(row, number, names, str(path))
            if number > most:
                raise InputError(f"{path}: more than {most:,} messages", "cut the bag into several")
            has_velocity = has_velocity and len(row.velocity) == len(names)
            velocity = row.velocity if len(row.velocity) == len(names) else np.full(len(names), np.nan)
            stamps.append((row.header.stamp.sec, row.header.stamp.nanosec))
            piece.append(np.concatenate([row.position, velocity, row.effort]))
            if len(piece) == PIECE_MESSAGES:
                store.append(np.array(piece, dtype=np.float64))
                piece = []
        if not stamps:
            raise InputError(
                f"{path}: no {MESSAGE_TYPE} on topic '{topic}'", "the log's states are expected on that topic"
            )
        if piece:
            store.append(np.array(piece, dtype=np.float64))
        seconds, fraction = np.array(stamps, dtype=np.float64).T
        return names, seconds + 1e-9 * fraction, store, has_velocity


def _require_alike(row: Any, number: int, names: tuple[str, ...], path: str) -> None:
    """InputError where a message does not fit the first one."""
    if not names or len(names) != len(dict.fromkeys(names)) or 4 * len(names) > LARGEST_COLUMNS:
        raise InputError(
            f"{path}: message 1 names {len(names)} joints: {listed([quoted(x) for x in names])}",
            "record messages that name every joint once",
        )
    if tuple(row.name) != names:
        raise InputError(
            f"{path}: message {number} names joints {listed([quoted(x) for x in row.name])}, "
            f"the first {listed([quoted(x) for x in names])}",
            "record the joints of each publisher on a separate topic",
        )
    for what in ("position", "effort"):
        if len(getattr(row, what)) != len(names):
            raise InputError(
                f"{path}: message {number} has {len(getattr(row, what))} {what}s for {len(names)} joints",
                "record a topic whose messages carry position and effort of every joint",
            )


def require_rosbags() -> None:
    """Raise InputError if the package rosbags is not installed."""
    try:
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError("ROS bags need rosbags", "pip install 'psdmc[calibrate]'") from error


def _any_reader(path: Path) -> Any:
    require_rosbags()
    from rosbags.highlevel import AnyReader

    return AnyReader([path])


def any_reader_topics(path: Path) -> tuple[str, ...]:
    """Return the topics with joint states in a bag that rosbags' AnyReader opens."""
    with _any_reader(path) as reader:
        return tuple(dict.fromkeys(c.topic for c in reader.connections if c.msgtype == MESSAGE_TYPE))


def any_reader_messages(path: Path, topic: str) -> Iterator[bytes]:
    """Yield the serialised joint states of a topic in a bag that rosbags' AnyReader opens."""
    with _any_reader(path) as reader:
        connections = [c for c in reader.connections if c.topic == topic and c.msgtype == MESSAGE_TYPE]
        for _, _, raw in reader.messages(connections=connections) if connections else ():
            yield bytes(raw)
