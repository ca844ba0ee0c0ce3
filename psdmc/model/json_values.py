"""Values of an untrusted JSON text, each checked for type and size.

Every function returns a value of the JSON text. If the value is wrong, it raises a ValueError with the name of the
value, what was found and what was expected.
"""

from __future__ import annotations

import math
import reprlib
from typing import Any

import numpy as np
from numpy.typing import NDArray


def record(value: object, what: str) -> dict[str, Any]:
    """Return a value that must be a JSON object, with unchecked keys. Raises ValueError if it is no object."""
    if not isinstance(value, dict):
        raise _wrong(value, what, "named values")
    return value


def part(of: object, name: str, what: str) -> Any:
    """An entry of a record."""
    values = record(of, what)
    if name not in values:
        raise ValueError(f"{what} has no '{name}'")
    return values[name]


def entries(value: object, what: str, most: int) -> list[Any]:
    """A list of at most `most` values."""
    if not isinstance(value, list):
        raise _wrong(value, what, "a list")
    if len(value) > most:
        raise ValueError(f"{what} has {len(value)} entries, expected at most {most}")
    return value


def text(value: object, what: str) -> str:
    """A string."""
    if not isinstance(value, str):
        raise _wrong(value, what, "a text")
    return value


def flag(value: object, what: str) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise _wrong(value, what, "true or false")
    return value


def number(value: object, what: str) -> float:
    """A finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise _wrong(value, what, "a number")
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    if not math.isfinite(found):
        raise _wrong(value, what, "a finite number")
    return found


def whole(value: object, what: str, least: int, most: int) -> int:
    """A whole number from `least` to `most`."""
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise _wrong(value, what, f"a whole number from {least} to {most}")
    return value


def numbers(value: object, what: str, *shape: int) -> NDArray[np.float64]:
    """Finite numbers in lists of that shape."""
    return np.array(_nested(value, what, shape), dtype=np.float64).reshape(shape)


def _nested(value: object, what: str, shape: tuple[int, ...]) -> Any:
    if not shape:
        return number(value, what)
    if not isinstance(value, list) or len(value) != shape[0]:
        raise _wrong(value, what, f"a list of {shape[0]}")
    return [_nested(one, what, shape[1:]) for one in value]


def _wrong(value: object, what: str, expected: str) -> ValueError:
    return ValueError(f"{what} is {reprlib.repr(value)}, expected {expected}")
