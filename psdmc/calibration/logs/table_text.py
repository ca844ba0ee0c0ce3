"""Text tables of any logger, of which only some columns are read: with or without a header, separated by comma,
semicolon, tab or spaces; other columns may hold anything.

Lines that start with # or % before the table are skipped; the last of them is the header where it has as many words as
the table has columns.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import BinaryIO

import numpy as np

from psdmc.calibration.logs.foreign_bytes import decoding
from psdmc.calibration.logs.log import Array
from psdmc.calibration.logs.table_csv import is_number, plain_text
from psdmc.calibration.logs.table_limits import require_size
from psdmc.calibration.logs.wording import quoted
from psdmc.errors import InputError
from psdmc.reading import in_words

SEPARATOR_WORDS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
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


@dataclass(frozen=True, slots=True)
class TextForm:
    """What is known of a table's form; None: told from its first lines. skip: lines before it that are not read."""

    separator: str | None = None
    header: bool | None = None
    skip: int = 0


class TextTable:
    """An open text table.

    names   of its columns, empty where it has no header
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
        """(k, len(places)) of these columns, in pieces; InputError names the line and column that is no number.

        dates   whether the first of them holds dates, which become s since 1970
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
        """The same where cells have decimal commas; else the InputError of the first cell that is no number."""
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
    """The rest of a text in pieces that end with a line, after what is `left` of it; InputError where a line is longer than
    a piece."""
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
    """s since 1970 of a date in ISO 8601's form, UTC where it names no zone; ValueError where it is none."""
    date = datetime.fromisoformat(text.strip().strip('"'))
    return (date if date.tzinfo is not None else date.replace(tzinfo=UTC)).timestamp()


def separator_of(line: str) -> str:
    """The separator that gives most cells."""
    counts = {mark: line.count(mark) for mark in (",", ";", "\t")}
    counts[" "] = len(line.split()) - 1
    if counts[";"] or counts["\t"]:  # commas may then be decimal ones
        return ";" if counts[";"] >= counts["\t"] else "\t"
    return "," if counts[","] else " "
