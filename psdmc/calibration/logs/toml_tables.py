"""Reads TOML files of a calibration key by key, and quotes texts for them. Every fault states its table and key."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard

from psdmc.calibration.logs.foreign_bytes import (
    LARGEST_TOML,
    SHORTER,
    decoding,
    first_faults,
    listed,
    opened,
    quoted,
)
from psdmc.errors import InputError
from psdmc.files import read_rest

LONGEST_LINE = 500
"""Characters of a line: the standard library's reader takes time that grows with the square of a dotted key's parts."""
LONGEST_TEXT = 300
"""Characters of a name or path."""
_ZIP = b"PK\x03\x04"


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Return the content of a TOML file. Raises InputError if it is missing, too large or no TOML.

    what   the expected kind of file for messages, such as 'a plant (.toml)'
    """
    with opened(path, LARGEST_TOML) as file:
        return toml_content(read_rest(file, LARGEST_TOML, str(path), SHORTER), str(path), what)


def toml_content(data: bytes, name: str, what: str) -> dict[str, Any]:
    """Return the content of a TOML file from its bytes."""
    if data.startswith(_ZIP):
        raise InputError(
            f"{name}: is a zip or npz file, such as a model: expected {what}", "give the text file"
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{name}: is no text in UTF-8: expected {what}", "save it as UTF-8") from error
    longest = max((len(line) for line in text.split("\n")), default=0)
    if longest > LONGEST_LINE:
        raise InputError(
            f"{name}: a line of {longest:,} characters, expected at most {LONGEST_LINE:,}", "break the line"
        )
    with decoding(name, "TOML", "correct it where it says"):
        return tomllib.loads(text.replace("\r\n", "\n"))


def toml_text(text: str) -> str:
    """Return a text in TOML's quotes. TOML has the escapes of JSON, and also requires one for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


class TomlTable:
    """A table of a TOML file whose values are read key by key, and checked.

    If a key is missing or wrong, the reading function adds a message to the list `faults`, and returns the default or a
    harmless value. The caller checks the list after reading all keys.
    """

    def __init__(self, value: object, where: str, keys: tuple[str, ...], faults: list[str]) -> None:
        self.where, self.faults = where, faults
        self.content: Mapping[str, Any] = value if isinstance(value, dict) else {}
        if not isinstance(value, dict):
            faults.append(f"{where}: found {shown(value)}, expected a table")
            return
        odd = [quoted(key) for key in value if key not in keys]
        if odd:
            faults.append(f"{where}: unknown key(s) {listed(odd)}, known are {', '.join(keys)}")

    def has(self, key: str) -> bool:
        return key in self.content

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """Return a number from `low` to `high`. A missing key is a fault if there is no default."""
        if key not in self.content and default is not None:
            return default
        value = self.content.get(key)
        if is_number(value) and low <= float(value) <= high:
            return float(value)
        self._fault(key, value, f"a number from {low:g} to {high:g}")
        return low

    def whole(self, key: str, low: int, high: int, default: int) -> int:
        """Return a whole number from `low` to `high`."""
        value = self.content.get(key, default)
        if is_number(value) and low <= value <= high and value == int(value):
            return int(value)
        self._fault(key, value, f"a whole number from {low} to {high}")
        return low

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text that is not empty, not longer than LONGEST_TEXT, and without control characters."""
        if key not in self.content and default is not None:
            return default
        value = self.content.get(key)
        if isinstance(value, str) and 0 < len(value) <= LONGEST_TEXT and value.isprintable():
            return value
        self._fault(key, value, f"a text of at most {LONGEST_TEXT} characters")
        return ""

    def word(self, key: str, words: tuple[str, ...], default: str | None = None) -> str:
        """Return the text of a key, which must be one of `words`. A missing key is a fault if there is no default."""
        if key not in self.content and default is not None:
            return default
        value = self.content.get(key)
        if isinstance(value, str) and value in words:
            return value
        self._fault(key, value, f"one of {', '.join(words)}")
        return words[0]

    def triple(self, key: str, largest: float) -> tuple[float, float, float]:
        """Return three numbers whose magnitude is at most `largest`."""
        value = self.content.get(key)
        if (
            isinstance(value, list)
            and len(value) == 3
            and all(is_number(x) and abs(x) <= largest for x in value)
        ):
            return (float(value[0]), float(value[1]), float(value[2]))
        self._fault(key, value, f"three numbers of at most {largest:g}")
        return (0.0, 0.0, 0.0)

    def items(self, key: str) -> list[Any]:
        """Return a list; it is empty if the key is missing."""
        value = self.content.get(key, [])
        if isinstance(value, list):
            return value
        self._fault(key, value, "a list")
        return []

    def _fault(self, key: str, value: object, expected: str) -> None:
        found = f"found {shown(value)}" if key in self.content else "missing"
        self.faults.append(f"{self.where}: {key}: {found}, expected {expected}")


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a TOML value is a finite number within the range of 64-bit floats."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def shown(value: object) -> str:
    """Return a TOML value as text for a message."""
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else f"a list of {len(value)}"
    if isinstance(value, int) and not is_number(value):
        return "a number that no double holds"
    return str(value)


def require_none(faults: list[str], name: str, hint: str) -> None:
    """Raise InputError with the first of the faults, if there are any."""
    if faults:
        raise InputError(f"{name}: {first_faults(faults)}", hint)
