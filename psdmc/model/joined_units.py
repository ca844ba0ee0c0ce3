"""Units of quantities that joints have by name: some turn, others slide."""

from __future__ import annotations

from collections.abc import Iterable


def joined_units(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """By a quantity's name the units of its values, each once and in order: 'Nm, N'."""
    found: dict[str, dict[str, None]] = {}
    for name, unit in pairs:
        found.setdefault(name, {})[unit] = None
    return {name: ", ".join(units) for name, units in found.items()}
