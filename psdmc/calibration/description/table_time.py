"""`[time]`: the column of time and its unit, or the rate of logs that have no such column."""

from __future__ import annotations

from dataclasses import dataclass

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.description.table_quantities import column_of
from psdmc.calibration.description.units import TIME_UNITS
from psdmc.calibration.logs.toml_tables import TomlTable

SLOWEST, FASTEST = 0.01, 1e6
"""Hz."""


@dataclass(frozen=True, slots=True)
class TimeEntry:
    """column: name or number from 1; unit: s per number in it; rate: Hz, of rows without a column of time; 0: there is
    one."""

    column: str | int = "time_s"
    unit: float = 1.0
    rate: float = 0.0


def _read(value: object, reading: Reading) -> TimeEntry:
    table = TomlTable(value, "time", ("column", "unit", "rate"), reading.faults)
    if table.has("rate"):
        if table.has("column") or table.has("unit"):
            reading.faults.append("time: rate: beside a column or unit, expected one or the other")
        return TimeEntry(rate=table.number("rate", SLOWEST, FASTEST))
    return TimeEntry(
        column_of(table, "column") if table.has("column") else "time_s",
        TIME_UNITS[table.word("unit", tuple(TIME_UNITS), "s")].size,
    )


TIME: Table[TimeEntry] = Table("time", _read, TimeEntry())
