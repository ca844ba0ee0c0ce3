"""Names of links and joints are any text that fits on a line; each is used once."""

from __future__ import annotations

import unicodedata
from collections import Counter
from collections.abc import Sequence


def naming_faults(names: Sequence[str], what: str) -> list[str]:
    """What is wrong with the names of a robot's links or joints, one sentence each."""
    counts = Counter(names)
    faults = [f"a {what} has no name"] if counts[""] else []
    faults += [f"{what} name {name!r} has control characters" for name in counts if _has_control(name)]
    return faults + [f"{n} {what}s are called '{name}'" for name, n in counts.items() if n > 1 and name]


def _has_control(name: str) -> bool:
    return any(unicodedata.category(letter) in ("Cc", "Zl", "Zp") for letter in name)
