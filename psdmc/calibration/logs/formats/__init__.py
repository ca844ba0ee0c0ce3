"""The formats of log files that psdmc reads. Each file in this folder describes one format by an object FORMAT."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from psdmc.calibration.logs.log_format import LogFormat, TableFormat
from psdmc.errors import InputError


def _found() -> tuple[LogFormat, ...]:
    names = sorted(module.name for module in iter_modules(__path__))
    return tuple(import_module(f"{__name__}.{name}").FORMAT for name in names)


FORMATS = _found()
TABLES = tuple(ending for each in FORMATS if isinstance(each, TableFormat) for ending in each.endings)
WRITTEN = tuple(
    each.endings[0]
    for each in FORMATS
    if isinstance(each, TableFormat) and type(each).write is not TableFormat.write
)
"""Endings of the tables that psdmc writes."""


def format_of(path: Path) -> LogFormat:
    """Return the log file format to which a file belongs. Raises InputError with the known suffixes if there is none."""
    for each in FORMATS:
        if each.sniff(path):
            return each
    known = ", ".join(ending for each in FORMATS for ending in each.endings)
    raise InputError(f"{path}: '{path.suffix}' is no log format", f"known are {known}")


def table_of(path: Path) -> TableFormat:
    """Return the format of a table file, such as CSV. Raises InputError with the known suffixes if the file is no
    table."""
    for each in FORMATS:
        if isinstance(each, TableFormat) and each.sniff(path):
            return each
    raise InputError(f"{path}: '{path.suffix}' is no table", f"known are {', '.join(TABLES)}")


def has_topics(path: Path) -> bool:
    """Return whether a path is a log with topics, such as a ROS bag."""
    return any(each.has_topics and each.sniff(path) for each in FORMATS)
