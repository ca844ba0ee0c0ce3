"""Torque constants on the command line."""

from __future__ import annotations

from psdmc.cli.lists import assignments
from psdmc.errors import InputError


def parsed_torque_constants(given: list[str] | None) -> dict[str, float] | None:
    """'joint=36.1,...' as a dict; None where nothing is given."""
    found: dict[str, float] = {}
    for word in assignments(given):
        name, _, value = word.rpartition("=")
        try:
            constant = float(value)
        except ValueError:
            raise InputError(f"--torque-constants: {word!r}", "write JOINT=NUMBER,JOINT=NUMBER") from None
        name = name.strip()
        if not name or name in found:
            what = f"joint {name!r} twice" if name else f"{word!r} names no joint"
            raise InputError(f"--torque-constants: {what}", "write JOINT=NUMBER,JOINT=NUMBER")
        found[name] = constant
    return found or None
