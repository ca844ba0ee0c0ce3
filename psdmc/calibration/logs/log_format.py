"""Base classes of log file formats: they recognise files, list columns, and read rows in pieces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from psdmc.calibration.logs.foreign_bytes import LARGEST_STORED, opened
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.stored_log import HELD_BYTES, AnyLog
from psdmc.calibration.logs.wording import quoted
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
