"""Reads numbers in robot files. A number must be a plain decimal in ASCII.

Python's float also accepts underscores, digits of other alphabets and other kinds of spaces. The C++ streams of urdfdom
accept none of them and read zero without a message. Because psdmc accepts only plain decimals, all readers get the same
number.
"""

from __future__ import annotations

import math
import re

from psdmc.robot.limits import MAX_CHARACTERS, TINIEST

WHITE_SPACE = " \t\n\r\f\v"
"""ASCII white space, which may stand around and between numbers."""

DECIMAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_GAP = re.compile(f"[{WHITE_SPACE}]+")
_NOT_ZERO = re.compile("[1-9]")


def words(text: str) -> list[str]:
    """Return the words of a text that are separated by ASCII white space."""
    return [word for word in _GAP.split(text) if word]


def decimal(word: str) -> float | None:
    """Return the number of a word; None if it is no finite decimal number, too long or too small."""
    if len(word) > MAX_CHARACTERS or not DECIMAL.fullmatch(word):
        return None
    value = float(word)
    if not math.isfinite(value) or (abs(value) < TINIEST and _has_digits(word)):
        return None
    return value


def _has_digits(word: str) -> bool:
    """Whether the digits before the exponent are other than zero."""
    return bool(_NOT_ZERO.search(word.lower().partition("e")[0]))
