"""`[time]`: the column of time and its unit, or the rate of logs that have no such column."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_quantities import column_of
from psdmc.calibration.description.units import TIME_UNITS
from psdmc.calibration.logs.toml_tables import TomlTable

SLOWEST, FASTEST = 0.01, 1e6
"""Hz."""
DATE = "date"
"""Unit of columns that hold dates."""


@dataclass(frozen=True, slots=True)
class TimeEntry:
    """The time of rows.

    column  name or number from 1
    unit    s per number in it
    rate    Hz, of rows without a column of time; 0: there is one
    dates   whether the column holds dates, such as 2026-05-01T12:00:00.125, whose s count from 1970
    """

    column: str | int = "time_s"
    unit: float = 1.0
    rate: float = 0.0
    dates: bool = False


def _read(value: object, reading: Reading) -> TimeEntry:
    table = TomlTable(value, "time", ("column", "unit", "rate"), reading.faults)
    if table.has("rate"):
        if table.has("column") or table.has("unit"):
            reading.faults.append("time: `rate` is given with `column` or `unit`, expected one or the other")
        return TimeEntry(rate=table.number("rate", SLOWEST, FASTEST))
    unit = table.word("unit", (*TIME_UNITS, DATE), "s")
    column = column_of(table, "column") if table.has("column") else "time_s"
    return TimeEntry(column, 1.0 if unit == DATE else TIME_UNITS[unit].size, dates=unit == DATE)


TIME: Table[TimeEntry] = Table("time", _read, TimeEntry())
