"""The table `[[log]]`: the recordings, whether they are for fitting or validation, and which part of each is used."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_quantities import column_of
from psdmc.calibration.description.units import TIME_UNITS
from psdmc.calibration.logs.log import USES, Use
from psdmc.calibration.logs.log_format import TextForm
from psdmc.calibration.logs.toml_tables import TomlTable, shown

SLOWEST, FASTEST = 0.01, 1e6
"""Hz."""
DATE = "date"
"""Unit of columns that hold dates."""


@dataclass(frozen=True, slots=True)
class TimeEntry:
    """How a log records the time of its rows.

    column  name of the time column, or its number from 1
    unit    seconds per unit of the column
    rate    sampling rate in Hz, if there is no time column; 0: there is a time column
    dates   whether the column holds dates, such as 2026-05-01T12:00:00.125; they are converted to seconds since 1970
    """

    column: str | int = "time_s"
    unit: float = 1.0
    rate: float = 0.0
    dates: bool = False


def _read_time(value: object, reading: Reading) -> TimeEntry:
    table = TomlTable(value, "time", ("column", "unit", "rate"), reading.faults)
    if table.has("rate"):
        if table.has("column") or table.has("unit"):
            reading.faults.append("time: `rate` is given with `column` or `unit`, expected one or the other")
        return TimeEntry(rate=table.number("rate", SLOWEST, FASTEST))
    unit = table.word("unit", (*TIME_UNITS, DATE), "s")
    column = column_of(table, "column") if table.has("column") else "time_s"
    return TimeEntry(column, 1.0 if unit == DATE else TIME_UNITS[unit].size, dates=unit == DATE)


TIME: Table[TimeEntry] = Table("time", _read_time, TimeEntry())


SEPARATOR_WORDS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
MOST_SKIPPED = 10_000


def _read_csv_form(value: object, reading: Reading) -> TextForm:
    table = TomlTable(value, "csv", ("separator", "header", "skip"), reading.faults)
    header = table.content.get("header")
    if header is not None and not isinstance(header, bool):
        reading.faults.append(f"csv: header: found {shown(header)}, expected true or false")
        header = None
    word = table.word("separator", tuple(SEPARATOR_WORDS), "") if table.has("separator") else ""
    return TextForm(
        separator=SEPARATOR_WORDS.get(word),
        header=header,
        skip=table.whole("skip", 0, MOST_SKIPPED, 0),
    )


CSV_FORM: Table[TextForm] = Table("csv", _read_csv_form, TextForm())


LARGEST_LOGS = 1000
"""As of a campaign's runs."""
LATEST = 86_400.0
"""s: a log lasts a day at most."""
MOST_TABLES = 20
KEYS = ("file", "tables", "use", "start", "end", "topic")


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One entry `[[log]]` of a log description: one recording.

    tables  files by name, relative to the working directory: one file without a name, or several files, each with other
            columns of the recording
    use     fit, or validate: the whole log is held out for validation
    start   s from the log's first row; earlier rows are left out
    end     s from the log's first row; later rows are left out
    topic   topic in a ROS bag; empty: the only topic, or /joint_states
    """

    tables: Mapping[str, Path]
    use: Use
    start: float
    end: float
    topic: str

    @property
    def name(self) -> str:
        """Name of the log for messages and reports."""
        return " + ".join(path.name for path in self.tables.values())


def _read(value: object, reading: Reading) -> tuple[LogEntry, ...]:
    if not isinstance(value, list) or not 0 < len(value) <= LARGEST_LOGS:
        reading.faults.append(f"log: found {shown(value)}, expected 1 to {LARGEST_LOGS} tables [[log]]")
        return ()
    found = tuple(_entry(table, f"log {k}", reading) for k, table in enumerate(value, start=1))
    if all(entry.use == "validate" for entry in found):
        reading.faults.append("log: every one is for validation, expected one for fitting")
    return found


def _entry(value: object, where: str, reading: Reading) -> LogEntry:
    table = TomlTable(value, where, KEYS, reading.faults)
    start, end = table.number("start", 0.0, LATEST, 0.0), table.number("end", 0.0, LATEST, math.inf)
    if end <= start:
        reading.faults.append(f"{where}: end: found {end:g}, expected more than its start, {start:g} s")
    return LogEntry(
        tables=_tables(table, where, reading),
        use=cast(Use, table.word("use", USES, "fit")),
        start=start,
        end=end,
        topic=table.text("topic", ""),
    )


def _tables(table: TomlTable, where: str, reading: Reading) -> dict[str, Path]:
    """Files by the name of their table."""
    if not table.has("tables"):
        return {"": reading.folder / table.text("file")}
    if table.has("file"):
        reading.faults.append(f"{where}: `tables` and `file` are both given, expected one of them")
    given = table.content["tables"]
    names = tuple(given) if isinstance(given, dict) else ()
    if not 0 < len(names) <= MOST_TABLES or any(not name for name in names):
        reading.faults.append(
            f"{where}: tables: found {shown(given)}, expected NAME = FILE, 1 to {MOST_TABLES}"
        )
        return {}
    inner = TomlTable(given, f"{where}: tables", names, reading.faults)
    return {name: reading.folder / inner.text(name) for name in names}


LOGS: Table[tuple[LogEntry, ...]] = Table("log", _read, ())
