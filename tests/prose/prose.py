"""Prints faults of the project's prose, or of another checkout's: python tests/prose/prose.py [--all] [TREE].

The rules are in house_style.py and linter.py, the texts in sources.py, faults that may stay in exceptions.txt. Files that
nobody has rewritten yet are in owed.txt with their number of faults; --all prints these faults as well."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import house_style
import linter
from house_style import Fault, Piece
from sources import ROOT, everything

EXCEPTIONS = Path(__file__).parent / "exceptions.txt"
OWED = Path(__file__).parent / "owed.txt"
MOST = {"sentence": 30, "paragraph": 5}
"""Most exceptions of each rule; other rules have none."""


@dataclass(frozen=True, slots=True)
class Result:
    """Faults that are no exceptions, exceptions that no fault needs, and how many exceptions each rule has."""

    faults: tuple[Fault, ...]
    unneeded: tuple[str, ...]
    exceptions: dict[str, int]

    def too_many(self) -> list[str]:
        """Rules that have more exceptions than they may."""
        return [rule for rule, count in self.exceptions.items() if count > MOST.get(rule, 0)]


def check(pieces: Sequence[Piece], exceptions: Sequence[str]) -> Result:
    """Faults of the pieces by every rule, without those that the exceptions name."""
    found = [*house_style.faults(pieces), *linter.faults(pieces)]
    names = {fault.name for fault in found}
    return Result(
        tuple(fault for fault in found if fault.name not in exceptions),
        tuple(line for line in exceptions if line not in names),
        dict(Counter(line.split(" | ")[1] for line in exceptions)),
    )


def owed(path: Path = OWED) -> dict[str, int]:
    """How many faults each file still has that nobody has rewritten yet. No file is added; numbers only fall."""
    lines = [line.rsplit(" ", 1) for line in listed(path)]
    return {file: int(count) for file, count in lines}


def breaks(faults: Sequence[Fault], allowed: dict[str, int]) -> list[str]:
    """The faults of files that owe none or fewer, and the files whose number in the list must fall."""
    counted = Counter(fault.file for fault in faults)
    more = [str(fault) for fault in faults if counted[fault.file] > allowed.get(fault.file, 0)]
    fewer = [
        f"{file} {counted[file]}: lower its number in owed.txt"
        for file, n in allowed.items()
        if counted[file] < n
    ]
    return [*more, *fewer]


def listed(path: Path = EXCEPTIONS) -> list[str]:
    """The exceptions of a list file, without its comments."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def main() -> int:
    given = [argument for argument in sys.argv[1:] if argument != "--all"]
    root = Path(given[0]).resolve() if given else ROOT
    result = check(everything(root), listed())
    faults = result.faults if "--all" in sys.argv else breaks(result.faults, owed())
    for line in (*faults, *(f"no longer needed: {line}" for line in result.unneeded)):
        print(line)
    print(dict(Counter(fault.rule for fault in result.faults)), file=sys.stderr)
    return 1 if faults or result.unneeded or result.too_many() else 0


if __name__ == "__main__":
    sys.exit(main())
