"""Units of quantities that all joints have. The unit differs between revolute and sliding joints."""

from __future__ import annotations

from collections.abc import Iterable


def joined_units(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return, for each quantity's name, the units of its values without duplicates, in order: 'Nm, N'."""
    found: dict[str, dict[str, None]] = {}
    for name, unit in pairs:
        found.setdefault(name, {})[unit] = None
    return {name: ", ".join(units) for name, units in found.items()}
