"""TOML files: their lines, or the values that they hold, written anew."""

from __future__ import annotations

import math
import tomllib
from random import Random
from typing import Any

from mutate_bytes import mutate_bytes, mutate_lines
from mutate_tree import mutate_tree


def mutate_toml(data: bytes, rng: Random) -> bytes:
    kind = rng.random()
    if kind < 0.05:
        return mutate_bytes(data, rng)
    if kind < 0.4:
        return mutate_lines(data, rng)
    try:
        table = tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError):
        return mutate_lines(data, rng)
    return toml_text(mutate_tree(table, rng)).encode("utf-8", errors="replace")


def toml_text(table: Any) -> str:
    """The values as TOML, one line per key of the root and of its tables; what TOML cannot hold is written as a text."""
    if not isinstance(table, dict):
        return f"value = {_value(table)}\n"
    plain, below = [], []
    for key, value in table.items():
        if isinstance(value, dict):
            below.append(f"[{_quoted(str(key))}]\n{_lines(value)}")
        elif isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            below += [f"[[{_quoted(str(key))}]]\n{_lines(row)}" for row in value]
        else:
            plain.append(_lines({key: value}))
    return "".join([*plain, *below])


def _lines(table: dict[Any, Any]) -> str:
    return "".join(f"{_quoted(str(key))} = {_value(value)}\n" for key, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return _integer(value)
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(_lines(value).splitlines()) + "}"
    return _quoted("null" if value is None else str(value))


def _integer(value: int) -> str:
    """In tens too, beyond what Python prints by itself."""
    return str(value) if abs(value) < 10**4000 else f"{value:#x}"


def _quoted(word: str) -> str:
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\U{ord(c):08X}" for c in word)
    return f'"{escaped}"'
