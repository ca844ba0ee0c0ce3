"""Tables and lines that commands print: columns without frames, names never cut, at most as wide as the terminal."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rich.cells import cell_len

from psdmc.cli.console import one_line
from psdmc.errors import WARNING

PLAIN_WIDTH = 80
"""Columns where the output is no terminal, and where a terminal does not say how wide it is."""

GAP = "  "
"""Between two columns."""

NARROWEST_PROSE = 24
"""Columns that a wrapped last column has at least, however narrow the terminal is."""

WORDS = " "
TERMS = r" (?=[-+] )"
"""Where prose is wrapped: between words, or between an equation's terms."""

BOLD, PLAIN = "\033[1m", "\033[0m"


@dataclass(frozen=True, slots=True)
class Table:
    """A table of texts, which may come from untrusted files.

    heads  head of each column
    keys   number of columns at the left that name a row; they are repeated if a table is printed in pieces
    prose  whether the last column is text that may be wrapped
    breaks a pattern: where the last column may be wrapped
    """

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    keys: int = 1
    prose: bool = False
    breaks: str = WORDS


def print_table(table: Table) -> None:
    """Print a table. If it is too wide, print it in pieces below each other, each with the key columns. Only a prose
    column is wrapped, and no cell is cut."""
    bold = sys.stdout.isatty()
    for number, piece in enumerate(pieces(table, line_width())):
        if number:
            print()
        head, *body = lines(piece, line_width())
        print(f"{BOLD}{head}{PLAIN}" if bold else head)
        print("\n".join(body))


def print_note(note: str) -> None:
    """Print a note on one line. A text that begins with "warning: " stays as it is; others get "note: " in front."""
    print_line(note if note.startswith(WARNING) else f"note: {note}")


def print_line(text: str) -> None:
    """Print untrusted text on one line, so that other programs can search it."""
    print(one_line(text))


def line_width() -> int:
    """Columns of the terminal, or PLAIN_WIDTH."""
    if not sys.stdout.isatty():
        return PLAIN_WIDTH
    return shutil.get_terminal_size((PLAIN_WIDTH, 24)).columns


def pieces(table: Table, width: int) -> Iterator[Table]:
    """Yield the table, or several narrower tables with the same key columns if it is wider than `width`."""
    widths = _widths(table)
    if table.prose:
        widths[-1] = min(widths[-1], NARROWEST_PROSE)
    columns = list(range(table.keys))
    for column in range(table.keys, len(table.heads)):
        wide = sum(widths[k] + len(GAP) for k in columns) + widths[column]
        if wide > width and len(columns) > table.keys:
            yield _of_columns(table, columns)
            columns = list(range(table.keys))
        columns.append(column)
    yield _of_columns(table, columns)


def _of_columns(table: Table, columns: Sequence[int]) -> Table:
    rows = [[row[k] for k in columns] for row in table.rows]
    prose = table.prose and columns[-1] == len(table.heads) - 1
    return Table([table.heads[k] for k in columns], rows, table.keys, prose, table.breaks)


def lines(table: Table, width: int) -> Iterator[str]:
    """A table's lines, its heads first."""
    widths = _widths(table)
    start = sum(each + len(GAP) for each in widths[:-1])
    for row in (table.heads, *table.rows):
        cells = [one_line(cell) for cell in row]
        if table.prose:
            first, *more = _wrapped(cells[-1], max(width - start, NARROWEST_PROSE), table.breaks)
            cells[-1] = first
        else:
            more = []
        yield GAP.join(_padded(cell, each) for cell, each in zip(cells, widths, strict=True)).rstrip()
        yield from (" " * start + rest for rest in more)


def _widths(table: Table) -> list[int]:
    columns = zip(table.heads, *table.rows, strict=True)
    return [max(cell_len(one_line(cell)) for cell in column) for column in columns]


def _padded(cell: str, width: int) -> str:
    return cell + " " * (width - cell_len(cell))


def _wrapped(text: str, width: int, breaks: str) -> list[str]:
    """Lines of `text`, at least one, as full as `width` admits."""
    first, *parts = re.split(breaks, text)
    found = [first]
    for part in parts:
        if cell_len(found[-1]) + 1 + cell_len(part) > width:
            found.append(part)
        else:
            found[-1] += f" {part}"
    return found
