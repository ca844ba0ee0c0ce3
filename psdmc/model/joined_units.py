"""Units of quantities such as torques, for a robot with revolute and sliding joints, whose units differ."""

from __future__ import annotations

from collections.abc import Iterable


def joined_units(pairs: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Return, for each quantity's name, its units as one text, each unit once: 'Nm, N'.

    pairs  (name, unit) of the quantity at each joint
    """
    found: dict[str, dict[str, None]] = {}
    for name, unit in pairs:
        found.setdefault(name, {})[unit] = None
    return {name: ", ".join(units) for name, units in found.items()}
