"""The class Table, which describes how one top-level key of a log description (log.toml) is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from psdmc.calibration.identify.linear_options import LinearOptions

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Reading:
    """Data that all tables need while a log description is read.

    folder       folder of the description: its paths are relative to it
    joint_names  joints of the model; None if no model is known, so that names cannot be checked
    faults       faults found so far, one line each: table, key, found, expected
    """

    folder: Path
    joint_names: tuple[str, ...] | None
    faults: list[str]


def unchanged(options: LinearOptions, value: object) -> LinearOptions:
    """Return the options of the fit unchanged, for tables that have no effect on them."""
    return options


@dataclass(frozen=True, slots=True)
class Table(Generic[T]):
    """One top-level key of a log description. Each has a module in this folder and an entry in `tables.TABLES`.

    key      its name in the file
    read     function that reads the TOML value; it never raises an error but adds faults to the reading's list
    default  the value if the file does not have the key
    options  function that returns the options of the linear fit, changed as the table says
    """

    key: str
    read: Callable[[object, Reading], T]
    default: T
    options: Callable[[LinearOptions, T], LinearOptions] = unchanged
