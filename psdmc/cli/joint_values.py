"""Values of joints on the command line: JOINT=NUMBER and JOINT=LOW:HIGH, and a load."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.cli.lists import assignments
from psdmc.errors import InputError

LARGEST_LOAD, SMALLEST_LOAD = 1e4, 1e-3
"""kg"""
LARGEST_ARM = 100.0
"""m, of a load's centre of mass from the tip."""


def joint_numbers(given: Sequence[str] | None, option: str) -> dict[str, float]:
    """JOINT=NUMBER,... by joint; InputError where a word is none, or a joint is named twice."""
    hint = "write JOINT=NUMBER,JOINT=NUMBER"
    return {name: _number(value, option, hint) for name, value in _named(given, option, hint).items()}


def acceleration_limits(given: Sequence[str] | None) -> tuple[float | None, dict[str, float]]:
    """One number for all joints that have no limit, and JOINT=NUMBER."""
    words = [word for value in given or () for word in ([value] if "=" in value else value.split(","))]
    alone = [word for word in words if "=" not in word]
    if len(alone) > 1:
        raise InputError(
            f"--acceleration: {len(alone)} numbers without a joint",
            "give one for all joints, or JOINT=NUMBER",
        )
    for_all = _number(alone[0], "--acceleration", "give a number, or JOINT=NUMBER") if alone else None
    return for_all, joint_numbers([word for word in words if "=" in word], "--acceleration")


def joint_ranges(given: Sequence[str] | None) -> dict[str, tuple[float, float]]:
    """JOINT=LOW:HIGH,... by joint."""
    hint = "write JOINT=LOW:HIGH, rad (m), as in --range elbow=-1.5:0.5"
    found: dict[str, tuple[float, float]] = {}
    for name, value in _named(given, "--range", hint).items():
        low, colon, high = value.partition(":")
        if not colon:
            raise InputError(f"--range: {value!r} is no range", hint)
        found[name] = (_number(low, "--range", hint), _number(high, "--range", hint))
    return found


def load_numbers(given: str | None) -> tuple[float, tuple[float, float, float]] | None:
    """MASS,X,Y,Z as kg and m; None for the word none."""
    if given is None or given.strip() == "none":
        return None
    hint = "write MASS,X,Y,Z: kg, and m in the tip's frame; or none, where the robot logs torques"
    words = given.split(",")
    if len(words) != 4:
        raise InputError(f"--load is {given!r}", hint)
    mass, *com = (_number(word, "--load", hint) for word in words)
    if not SMALLEST_LOAD <= mass <= LARGEST_LOAD:
        raise InputError(f"--load: {mass:g} kg, expected {SMALLEST_LOAD:g} to {LARGEST_LOAD:g}", hint)
    if not all(abs(value) <= LARGEST_ARM for value in com):
        raise InputError(f"--load: its centre of mass is more than {LARGEST_ARM:g} m away", hint)
    return mass, (com[0], com[1], com[2])


def _named(given: Sequence[str] | None, option: str, hint: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for word in assignments(given):
        name, _, value = word.rpartition("=")
        name = name.strip()
        if not name or name in found:
            what = f"joint {name!r} twice" if name else f"{word!r} names no joint"
            raise InputError(f"{option}: {what}", hint)
        found[name] = value
    return found


def _number(text: str, option: str, hint: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option}: {text!r} is no number", hint) from None
