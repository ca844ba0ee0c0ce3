"""Reads text tables of loggers and spreadsheets, such as CSV. Every error states line and column.

Files are UTF-8, with or without a byte-order mark. Comma, semicolon, tab or spaces separate the cells. If the
separator is not a comma, numbers may have decimal commas. A table whose columns a log description names may lack a
header, may begin with comment lines, and may hold anything in its other columns.
"""

from __future__ import annotations

import codecs
import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import (
    LARGEST_FILE,
    SHORTER,
    decoding,
    quoted,
    require_names,
    require_size,
)
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.log_format import Columns, Pieces, TableFormat, TextForm
from psdmc.errors import InputError
from psdmc.files import in_words, read_rest

SEPARATORS = (",", ";", "\t", SPACE := " ")
"""The last stands for any number of spaces."""
TIME = "time_s"
COMMENTS = ("#", "%")
MOST_COMMENTS = 10_000
"""Lines before a table."""
LARGEST_LINE = 1024**2
"""Bytes: a thousand columns with names of a thousand letters."""
PIECE_BYTES = 16 * 1024**2
"""Of text that is parsed at once, and most of a line."""
DATE_HINT = "where that is the time: unit = 'date' in [time] of a log description"
HINT = (
    "[csv] of a log description says where the table starts, what separates it, and whether it has a header"
)

_OTHER_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)


class TextFormat(TableFormat):
    endings = (".csv", ".txt", ".tsv", ".dat", ".log")

    def columns_of(self, file: BinaryIO, name: str, form: TextForm) -> Columns:
        table = TextTable(file, name, form)
        return Columns(name, table.names, table.width, table.rows)

    def pieces(self, file: BinaryIO, name: str) -> Pieces:
        """Return the column names of a CSV file, and its rows as a sequence of parts that end with a complete line."""
        file = _with_line_ends(file, name)
        reader = CsvReader(name)
        names: list[str] = []
        while not names:
            line = file.readline(PIECE_BYTES)
            if not line:
                raise InputError(
                    f"{name}: holds no table",
                    "the first line names the columns: time_s,position_rad.<joint>,...",
                )
            names = reader.header(line)
        return names, (rows for text in whole_lines(file, name) if len(rows := reader.rows(text)))

    def write(self, columns: Mapping[str, Array], path: Path) -> None:
        header = ",".join(_cell(column) for column in columns)
        values = np.column_stack(list(columns.values()))
        np.savetxt(path, values, "%.17g", ",", header=header, comments="", encoding="utf-8")


def _cell(name: str) -> str:
    """A name as a CSV cell: quoted where it would not be one cell otherwise."""
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',;"\t') else name


def _with_line_ends(file: BinaryIO, name: str) -> BinaryIO:
    """The file; if CR alone ends its lines, its text with LF instead."""
    start = file.read(LARGEST_LINE)
    file.seek(0)
    if b"\n" in start or b"\r" not in start:
        return file
    return io.BytesIO(read_rest(file, LARGEST_FILE, name, SHORTER).replace(b"\r", b"\n"))


class CsvReader:
    """Reads a CSV file in pieces: its header, then complete lines. Errors state the number of the line."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._line = 0
        self._separator = SEPARATORS[0]
        self._names: list[str] = []
        self._decimal = ""

    def header(self, line: bytes) -> list[str]:
        """Return the column names in the next line of the file; an empty list if the line is empty."""
        self._line += 1
        text = plain_text(line, self.name, self._line - 1).strip("\n")
        if not text.strip():
            return []
        self._separator = _separator(text)
        with decoding(f"{self.name}: line {self._line}", "a header"):
            self._names = _cells(text, self._separator)
        _require_header(self._names, self.name)
        require_names(self._names, self.name)
        return self._names

    def rows(self, lines: bytes) -> Array:
        """Return the numbers (rows, columns) in complete lines."""
        body = plain_text(lines, self.name, self._line)
        first, self._line = self._line + 1, self._line + body.count("\n")
        if not body.strip():
            return np.zeros((0, len(self._names)))
        body = self._pointed(body)
        values = _numbers(body, self._separator)
        if values is None or values.shape[1] != len(self._names):
            raise _first_fault(body, self._names, self._separator, first, self.name)
        return values

    def _pointed(self, body: str) -> str:
        """The text with decimal commas changed to points, where all pieces agree."""
        if self._separator == ",":
            return body
        found = "".join(mark for mark in ",." if mark in body)
        if "".join(sorted({*found, *self._decimal})) == ",.":
            return _with_points(",.", self._separator, self.name)
        self._decimal = found or self._decimal
        return body.replace(",", ".")


def plain_text(data: bytes, name: str, before: int = 0) -> str:
    """Return the text of some bytes of a CSV file, with plain line ends.

    before  number of lines in the file before these bytes, for line numbers in errors
    """
    for mark, encoding in _OTHER_MARKS:
        if data.startswith(mark):
            raise InputError(f"{name}: is {encoding} text, expected UTF-8", "save it as CSV in UTF-8")
    if b"\0" in data:
        raise InputError(
            f"{name}: not a CSV file: it holds binary data or UTF-16 text", "save it as CSV in UTF-8"
        )
    data = data.removeprefix(codecs.BOM_UTF8)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = before + data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{name}: line {line}: byte 0x{data[error.start]:02x} is no UTF-8", "save it as CSV in UTF-8"
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _separator(header: str) -> str:
    """The separator that leaves a column of time; else the one with most columns, spaces only as the last."""
    counts: dict[str, int] = {}
    for separator in SEPARATORS:
        try:
            cells = _cells(header, separator)
        except csv.Error:
            continue
        if TIME in cells:
            return separator
        counts[separator] = len(cells)
    marked = {mark: count for mark, count in counts.items() if mark != SPACE and count > 1}
    likely = marked or counts
    return max(likely, key=lambda mark: likely[mark], default=SEPARATORS[0])


def _cells(line: str, separator: str) -> list[str]:
    words = line.strip() if separator == SPACE else line
    reader = csv.reader([words], delimiter=separator, skipinitialspace=separator == SPACE)
    return [cell.strip() for cell in next(reader, [])]


def _require_header(names: Sequence[str], name: str) -> None:
    expected = f"expected a first line such as {TIME},position_rad.<joint>,motor_torque_nm.<joint>"
    if all(is_number(cell) for cell in names):
        raise InputError(f"{name}: no header: its first line holds numbers", expected)
    nameless = [k for k, cell in enumerate(names, start=1) if not cell]
    if nameless:
        raise InputError(f"{name}: column {nameless[0]} of {len(names)} has no name in the header", expected)


def _with_points(body: str, separator: str, name: str) -> str:
    """The text with decimal commas changed to points. InputError where both occur: they may be thousands' separators."""
    if separator == "," or "," not in body:
        return body
    if "." in body:
        raise InputError(
            f"{name}: numbers with both ',' and '.'", "write them with a point, and without thousands' marks"
        )
    return body.replace(",", ".")


def _numbers(body: str, separator: str) -> Array | None:
    """(rows, columns), or None where a cell is no number or a line has more cells than another."""
    try:
        mark = None if separator == SPACE else separator
        return np.loadtxt(body.split("\n"), delimiter=mark, comments=None, quotechar='"', ndmin=2)
    except (ValueError, csv.Error):
        return None


def _first_fault(body: str, names: Sequence[str], separator: str, first: int, name: str) -> InputError:
    """The fault of the first wrong line; `first` is the number of the body's first line."""
    lines = body.split("\n")
    for number, line in enumerate(lines, start=first):
        if not line:
            continue
        try:
            cells = _cells(line, separator)
        except csv.Error as error:
            return InputError(
                f"{name}: line {number}: {error}", "export it as plain numbers separated by commas"
            )
        if len(cells) != len(names):
            is_cut = line is lines[-1] and len(cells) < len(names)  # no line end follows
            return InputError(
                f"{name}: line {number} has {len(cells)} cells under {len(names)} names",
                "the file ends within its last line: delete this line, or copy the log again"
                if is_cut
                else "each line has one cell per column",
            )
        for column, cell in zip(names, cells, strict=True):
            if not is_number(cell):
                return _no_number(name, number, column, cell)
    return InputError(f"{name}: not a table of numbers", "export it as plain numbers separated by commas")


def _no_number(name: str, line: int, column: str, cell: str) -> InputError:
    what = f"{quoted(cell)} is no number" if cell else "the cell is empty"
    decimal = is_number(cell.replace(",", ".", 1))
    comma = "decimal commas are read where ';', tab or spaces separate the columns"
    hint = comma if decimal else "below the header each cell is a number"
    return InputError(f"{name}: line {line}, column {quoted(column)}: {what}", hint)


def is_number(cell: str) -> bool:
    """Return whether psdmc reads a cell as a number: ASCII, without underscores."""
    if not cell.isascii() or "_" in cell:
        return False
    try:
        float(cell)
    except ValueError:
        return False
    return True


class TextTable:
    """An open text table.

    names   names of its columns, empty if it has no header
    width   number of columns
    """

    def __init__(self, file: BinaryIO, name: str, form: TextForm) -> None:
        self._file, self.name = file, name
        self._line = 0
        self._first = ""
        self._separator = form.separator or ","
        self._dated: int | None = None
        comment = self._skipped(form.skip)
        if not self._first.strip():
            raise InputError(f"{name}: holds no table", HINT)
        self._separator = form.separator or separator_of(self._first)
        cells = self._cells(self._first)
        has_header = form.header if form.header is not None else not all(is_number(cell) for cell in cells)
        self.names: tuple[str, ...] = tuple(cells) if has_header else ()
        self.width = len(cells)
        if has_header:
            self._first = ""
        elif len(words := self._cells(comment)) == self.width and not all(is_number(word) for word in words):
            self.names = tuple(words)
        require_size(0, self.width, 0, name)

    def _skipped(self, skip: int) -> str:
        """Read up to the table's first line; returns the last comment before it."""
        comment = ""
        for count in range(skip + MOST_COMMENTS):
            raw = self._file.readline(LARGEST_LINE)
            if not raw:
                break
            self._line += 1
            if count < skip:
                continue
            line = plain_text(raw, self.name, self._line - 1).strip("\n")
            if "\n" in line:
                raise InputError(
                    f"{self.name}: its lines end with CR alone", "save it with line ends LF or CR LF"
                )
            if line.lstrip().startswith(COMMENTS):
                comment = line.lstrip().lstrip("#%").strip()
            elif line.strip():
                self._first = line
                break
        return comment

    def _cells(self, line: str) -> list[str]:
        if self._separator == " ":
            return line.split()
        with decoding(f"{self.name}: line {self._line}", "a line of a table", HINT):
            return [cell.strip() for cell in next(csv.reader([line], delimiter=self._separator), [])]

    def rows(self, places: Sequence[int], dates: bool = False) -> Iterator[Array]:
        """Yield the numbers in some columns of the table, in parts (rows, len(places)).

        places  indices of the columns
        dates   True: the first of these columns holds dates. The result has seconds since 1970 in place of the dates

        Raises InputError with the line and column of a cell that is no number.
        """
        self._dated = places[0] if dates else None
        line, left = (self._line, self._first.encode() + b"\n") if self._first else (self._line + 1, b"")
        for piece in whole_lines(self._file, self.name, left):
            text = plain_text(piece, self.name, line - 1)
            yield self._numbers(text, line, places)
            line += text.count("\n")

    def _numbers(self, text: str, line: int, places: Sequence[int]) -> Array:
        if not text.strip():
            return np.zeros((0, len(places)))
        separator = None if self._separator == " " else self._separator
        try:
            with decoding(self.name, "a table"):
                return np.loadtxt(
                    text.split("\n"),
                    delimiter=separator,
                    comments=None,
                    quotechar='"',
                    usecols=tuple(places),
                    converters=None if self._dated is None else {self._dated: seconds_of},
                    encoding="utf-8",
                    ndmin=2,
                )
        except InputError:
            return self._one_by_one(text, line, places)

    def _one_by_one(self, text: str, line: int, places: Sequence[int]) -> Array:
        """Read the rows of a block whose cells have decimal commas. Raises InputError at the first cell that is no
        number."""
        found = []
        for number, words in enumerate(text.split("\n"), start=line):
            if not words.strip():
                continue
            cells = self._cells(words)
            if len(cells) <= max(places):
                raise InputError(
                    f"{self.name}: line {number} has {len(cells)} cells, expected {self.width}", HINT
                )
            found.append([self._number(cells[k], number, k) for k in places])
        return np.array(found, dtype=np.float64).reshape(-1, len(places))

    def _number(self, cell: str, line: int, place: int) -> float:
        column = quoted(self.names[place]) if self.names else str(place + 1)
        if place == self._dated:
            try:
                return seconds_of(cell)
            except (ValueError, OverflowError):
                raise InputError(
                    f"{self.name}: line {line}, column {column}: {quoted(cell)} is no date", HINT
                ) from None
        word = cell.replace(",", ".") if self._separator != "," and cell.count(",") == 1 else cell
        if ("." in cell and "," in cell) or not is_number(word):
            what = f"{quoted(cell)} is no number" if cell else "the cell is empty"
            hint = DATE_HINT if _is_date(cell) else HINT
            raise InputError(f"{self.name}: line {line}, column {column}: {what}", hint)
        return float(word)


def whole_lines(file: BinaryIO, name: str, left: bytes = b"") -> Iterator[bytes]:
    """Yield the rest of a text file in parts of complete lines. Raises InputError if a line is longer than a part.

    left  text before the rest of the file, which the first part begins with
    """
    while chunk := file.read(PIECE_BYTES):
        end = chunk.rfind(b"\n") + 1
        if not end and len(left) + len(chunk) > PIECE_BYTES:
            raise InputError(
                f"{name}: a line of more than {in_words(PIECE_BYTES)}", "write one row of the table per line"
            )
        if end:
            yield left + chunk[:end]
        left = chunk[end:] if end else left + chunk
    yield left


def _is_date(text: str) -> bool:
    try:
        seconds_of(text)
    except (ValueError, OverflowError):
        return False
    return True


def seconds_of(text: str) -> float:
    """Return the seconds since 1970 of an ISO 8601 date, UTC without a time zone. Raises ValueError for other text."""
    date = datetime.fromisoformat(text.strip().strip('"'))
    return (date if date.tzinfo is not None else date.replace(tzinfo=UTC)).timestamp()


def separator_of(line: str) -> str:
    """Return the separator that divides a line into most cells."""
    counts = {mark: line.count(mark) for mark in (",", ";", "\t")}
    counts[" "] = len(line.split()) - 1
    if counts[";"] or counts["\t"]:  # commas may then be decimal ones
        return ";" if counts[";"] >= counts["\t"] else "\t"
    return "," if counts[","] else " "


FORMAT = TextFormat()
