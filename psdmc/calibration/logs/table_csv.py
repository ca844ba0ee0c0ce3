"""CSV files of loggers and spreadsheets: named columns of numbers, every fault with its line and column.

UTF-8, with or without a byte-order mark; cells separated by comma, semicolon, tab or spaces, quoted or not. Where no comma
separates them, numbers may have decimal commas.
"""

from __future__ import annotations

import codecs
import csv
from collections.abc import Sequence

import numpy as np

from psdmc.calibration.logs.foreign_bytes import decoding
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.table_limits import require_names, require_size
from psdmc.calibration.logs.wording import quoted
from psdmc.errors import InputError

SEPARATORS = (",", ";", "\t", SPACE := " ")
"""The last stands for any number of spaces."""
TIME = "time_s"

_OTHER_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)


def columns_from_csv(data: bytes, name: str) -> dict[str, Array]:
    """Named columns of a CSV file's bytes; InputError says which line and column is no number."""
    first, header, body = _header_and_body(plain_text(data, name), name)
    separator = _separator(header)
    with decoding(f"{name}: line {first}", "a header"):
        names = _cells(header, separator)
    _require_header(names, name)
    require_names(names, name)
    if not body.strip():
        raise InputError(f"{name}: no rows under its header", "record or export it again")
    require_size(body.count("\n") + 1, len(names), len(data), name)
    body = _with_points(body, separator, name)
    values = _numbers(body, separator)
    if values is None or values.shape[1] != len(names):
        raise _first_fault(body, names, separator, first + 1, name)
    return {column: values[:, k] for k, column in enumerate(names)}


class CsvReader:
    """A CSV file piece by piece: its header, then whole lines in order; faults carry the line's number in the file."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._line = 0
        self._separator = SEPARATORS[0]
        self._names: list[str] = []
        self._decimal = ""

    def header(self, line: bytes) -> list[str]:
        """The column names of the next line; none where it is empty."""
        self._line += 1
        text = plain_text(line, self.name).strip("\n")
        if not text.strip():
            return []
        self._separator = _separator(text)
        with decoding(f"{self.name}: line {self._line}", "a header"):
            self._names = _cells(text, self._separator)
        _require_header(self._names, self.name)
        require_names(self._names, self.name)
        return self._names

    def no_header(self) -> list[str]:
        """The InputError of a file that ends before a header."""
        _header_and_body("", self.name)
        return []

    def rows(self, lines: bytes) -> Array:
        """(rows, columns) of whole lines."""
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


def header_names(line: bytes, name: str) -> tuple[str, ...]:
    """The column names of a CSV file's first line."""
    _, header, _ = _header_and_body(plain_text(line, name), name)
    with decoding(name, "a header"):
        return tuple(_cells(header, _separator(header)))


def plain_text(data: bytes, name: str, before: int = 0) -> str:
    """Bytes as text with plain line ends; `before` lines came before them."""
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


def _header_and_body(text: str, name: str) -> tuple[int, str, str]:
    """The first line that is not empty, its number, and the rest."""
    stripped = text.lstrip("\n")
    header, _, body = stripped.partition("\n")
    if not header.strip():
        raise InputError(
            f"{name}: holds no table", "the first line names the columns: time_s,position_rad.<joint>,..."
        )
    return len(text) - len(stripped) + 1, header, body


def _separator(header: str) -> str:
    """The separator that leaves a column of time; else the one that leaves most columns, spaces only where no other mark
    separates any."""
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
    for number, line in enumerate(body.split("\n"), start=first):
        if not line:
            continue
        try:
            cells = _cells(line, separator)
        except csv.Error as error:
            return InputError(
                f"{name}: line {number}: {error}", "export it as plain numbers separated by commas"
            )
        if len(cells) != len(names):
            return InputError(
                f"{name}: line {number} has {len(cells)} cells under {len(names)} names",
                "each line has one cell per column",
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
    """Whether a cell is a number as psdmc reads one: ASCII, without underscores."""
    if not cell.isascii() or "_" in cell:
        return False
    try:
        float(cell)
    except ValueError:
        return False
    return True
