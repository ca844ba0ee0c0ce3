"""Reads the values of TOML tables: of DH tables and of closed loops. Each value is checked, and all faults are collected."""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

from psdmc.errors import InputError
from psdmc.robot import limits
from psdmc.robot.limits import WHITE_SPACE, Range, decimal, shown

# Readers of values: each returns a typed value, or raises ValueError with what was found and expected.
Triple = tuple[float, float, float]


def angle(value: object, accepted: Range = limits.ANGLE) -> float:
    """Return an angle in rad from a number or a text such as "90 deg" or "1.5 rad". Raises ValueError."""
    if not isinstance(value, str):
        return within(accepted)(value)
    plain = value.strip(WHITE_SPACE)
    number, unit = decimal(plain[:-3].strip(WHITE_SPACE)), plain[-3:]
    if number is None or unit not in ("deg", "rad"):
        raise ValueError(f'{shown(value)} is no angle: write radians, or "90 deg"')
    return within(accepted)(math.radians(number) if unit == "deg" else number)


def finite(value: object) -> float:
    """Return a number read from a file if it is finite as a 64-bit float. Raises ValueError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"found {shown(value)}, expected a finite number")
    if not abs(value) <= sys.float_info.max:
        raise ValueError(f"found {shown(value)}, expected a finite number")
    return float(value)


def within(accepted: Range) -> Callable[[object], float]:
    """Return a reader of finite numbers within a range, which its ValueError names."""

    def convert(value: object) -> float:
        number = finite(value)
        fault = accepted.fault(number)
        if fault:
            raise ValueError(f"{number:g} {fault}")
        return number

    return convert


def toml_content(text: str, source: str, hint: str) -> dict[str, Any]:
    """Return the content of a TOML text. Raises InputError with the reason and the hint if the text is no TOML."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        reason = "nested too deeply"
    except ValueError as error:  # also of integers of thousands of digits
        reason = " ".join(str(error).split())
    raise InputError(f"{source}: not a TOML file: {reason}", hint)


class CheckedTable:
    """Reads one TOML table key by key. All faults are collected in `problems`, each with the name of the table."""

    def __init__(self, value: object, where: str, keys: tuple[str, ...], problems: list[str]) -> None:
        self.where, self.problems = where, problems
        self.table: Mapping[str, Any] = value if isinstance(value, dict) else {}
        if not isinstance(value, dict):
            problems.append(f"{where}: found {shown(value)}, expected a table")
        for key in self.table:
            if key not in keys:
                problems.append(f"{where}: unknown key {shown(key)} (known: {', '.join(keys)})")

    def read(self, key: str, convert: Callable[[Any], Any], default: Any) -> Any:
        """Return a key's value, converted by a reading function; `default` if it is missing or wrong."""
        if key not in self.table:
            return default
        try:
            return convert(self.table[key])
        except ValueError as error:
            self.problems.append(f"{self.where}: {key}: {error}")
            return default


LENGTH = within(limits.LENGTH)
"""A reader of lengths, m."""


def as_it_is(value: object) -> object:
    """Return a value of a file unchanged. This reading function is for values whose parts are read one by one."""
    return value


def plain_text(value: object) -> str:
    """Return a value of a file if it is a text that is not empty. Raises ValueError for anything else."""
    if not isinstance(value, str) or not value:
        raise ValueError(f"found {shown(value)}, expected a text")
    return value


def any_list(value: object) -> list[object]:
    """Return a value of a file if it is a list, with entries of any type. Raises ValueError for anything else."""
    if not isinstance(value, list):
        raise ValueError(f"found {shown(value)}, expected a list")
    return value


def triple_of(convert: Callable[[object], float]) -> Callable[[object], Triple]:
    """Return a reading function for lists of three values. `convert` reads each of the values."""

    def read(value: object) -> Triple:
        values = any_list(value)
        if len(values) != 3:
            raise ValueError(f"found {shown(value)}, expected three numbers")
        x, y, z = (convert(v) for v in values)
        return (x, y, z)

    return read


def not_negative(convert: Callable[[object], float]) -> Callable[[object], float]:
    """Return a reading function for numbers that must not be negative. `convert` reads the number."""

    def read(value: object) -> float:
        number = convert(value)
        if number < 0.0:
            raise ValueError(f"found {number:g}, expected no less than zero")
        return number

    return read


def one_of(*words: str) -> Callable[[object], str]:
    """Return a reading function that accepts only one of the given words."""

    def read(value: object) -> str:
        if not isinstance(value, str) or value not in words:
            raise ValueError(f"found {shown(value)}, expected one of {', '.join(words)}")
        return str(value)

    return read
