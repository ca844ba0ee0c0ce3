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
    """Data that are needed to read any table of a log description.

    folder       folder of the description: its paths are relative to it
    joint_names  joints of the model; None if no model is known, so that names cannot be checked
    faults       faults found so far, one line each: table, key, found, expected
    """

    folder: Path
    joint_names: tuple[str, ...] | None
    faults: list[str]


def unchanged(options: LinearOptions, value: object) -> LinearOptions:
    """Return the options of the linear fit unchanged, for tables that do not affect them."""
    return options


@dataclass(frozen=True, slots=True)
class Table(Generic[T]):
    """How one top-level key of a log description (log.toml) is read. Each key has a module in this folder and an entry
    in `tables.TABLES`.

    key      its name in the file
    read     function that returns the value of the key from TOML. It raises no error: it adds a text about each fault
             to the list `faults` of the Reading
    default  the value if the file does not have the key
    options  function that returns the options of the linear fit, changed by the value of the key
    """

    key: str
    read: Callable[[object, Reading], T]
    default: T
    options: Callable[[LinearOptions, T], LinearOptions] = unchanged
