"""The logs that a description describes, in SI units and with the model's joint names."""

from __future__ import annotations

from dataclasses import replace

from psdmc.calibration.description.description import LogDescription
from psdmc.calibration.description.table_logs import LOGS, LogEntry
from psdmc.calibration.logs.open_log import open_log
from psdmc.calibration.logs.stored_log import AnyLog
from psdmc.progress import Progress


def described_logs(description: LogDescription, progress: Progress) -> tuple[AnyLog, ...]:
    """All logs of a description; InputError where a file is missing or is not what the description says."""
    return tuple(_described(entry, progress) for entry in description.part(LOGS))


def _described(entry: LogEntry, progress: Progress) -> AnyLog:
    return replace(open_log(entry.file, progress), use=entry.use)
