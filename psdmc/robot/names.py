"""Checks the names of links and joints. A name is any text that fits on one line, and no two are equal."""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Sequence

from psdmc.robot.limits import MAX_NAME, shown


def naming_faults(names: Sequence[str], what: str) -> list[str]:
    """Return what is wrong with the names of a robot's links or joints, one sentence for each fault."""
    counts = Counter(names)
    faults = [f"a {what} has no name"] if counts[""] else []
    faults += [fault for name in counts for fault in name_faults(name, what)]
    return faults + [f"{n} {what}s are called {shown(name)}" for name, n in counts.items() if n > 1 and name]


def name_faults(name: str, what: str) -> list[str]:
    """Return what is wrong with one name, one sentence for each fault."""
    faults = [f"{what} name {shown(name)} has control characters"] if _has_control(name) else []
    if len(name) > MAX_NAME:
        faults.append(f"{what} name {shown(name)}: expected at most {MAX_NAME}")
    return faults


def _has_control(name: str) -> bool:
    """Control characters, line and paragraph separators, and halves of a character that no file can hold."""
    return any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in name)


def free_name(wanted: str, taken: set[str]) -> str:
    """Return `wanted`, with underscores appended until the name is not in `taken`. The name is then added to `taken`."""
    while wanted in taken:
        wanted += "_"
    taken.add(wanted)
    return wanted
