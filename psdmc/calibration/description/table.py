"""A table of a log description: one top-level key of its TOML file, and how it is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

from psdmc.calibration.identify.linear_options import LinearOptions

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Reading:
    """What the readers of tables share.

    folder       of the description: its paths start there
    joint_names  of the model; None where no model is known, and names cannot be checked
    faults       found so far, each in one line: table, key, found, expected
    """

    folder: Path
    joint_names: tuple[str, ...] | None
    faults: list[str]


def unchanged(options: LinearOptions, value: object) -> LinearOptions:
    """The options of the fit, of which a table says nothing."""
    return options


@dataclass(frozen=True, slots=True)
class Table(Generic[T]):
    """A top-level key. A new one is a file of this folder, with its entry in `tables.TABLES`.

    key      in the file
    read     the value of TOML's; never raises, faults go to the reading's list
    default  the value where the file has no such key
    options  the linear fit's options with what the table says
    """

    key: str
    read: Callable[[object, Reading], T]
    default: T
    options: Callable[[LinearOptions, T], LinearOptions] = unchanged
