"""`[[log]]`: the recordings, which of them are for fitting and which for validation, and the part that counts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

from psdmc.calibration.description.table import Reading, Table
from psdmc.calibration.logs.log import USES, Use
from psdmc.calibration.logs.toml_tables import TomlTable, shown

LARGEST_LOGS = 1000
"""As of a campaign's runs."""
LATEST = 86_400.0
"""s: a log lasts a day at most."""
KEYS = ("file", "use", "start", "end", "topic")


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One `[[log]]`.

    file        relative to the working directory
    use         fit, or validate: held out as a whole
    start, end  s from the log's first row; rows outside are left out
    topic       of a bag; empty: its only one, or /joint_states
    """

    file: Path
    use: Use
    start: float
    end: float
    topic: str


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
    start, end = table.number("start", 0.0, LATEST, 0.0), table.number("end", 0.0, LATEST, LATEST)
    if end <= start:
        reading.faults.append(f"{where}: end: found {end:g}, expected more than its start, {start:g} s")
    return LogEntry(
        file=reading.folder / table.text("file"),
        use=cast(Use, table.word("use", USES, "fit")),
        start=start,
        end=end,
        topic=table.text("topic", ""),
    )


LOGS: Table[tuple[LogEntry, ...]] = Table("log", _read, ())
