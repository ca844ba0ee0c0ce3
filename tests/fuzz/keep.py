"""Finds made small, and kept: corpus entries that tests replay."""

from __future__ import annotations

import json
from pathlib import Path

from formats import FORMATS
from isolated import outcome_in_child
from minimise import minimised
from outcome import warnings_are_errors
from recorder import Find
from worker import scratch

CORPUS = Path(__file__).parent / "corpus"
OWED = CORPUS / "owed.json"
"""Entry -> how it breaks the rule today."""


def made_small(find: Find, around: Path, seconds: float) -> None:
    """Put the smallest input found within this time, for which the same fault shows, in the find's place."""
    format, data = FORMATS[find.format], find.data
    with scratch(around) as folder, warnings_are_errors():
        format.set_up(folder)

        def shows(data: bytes) -> bool:
            return outcome_in_child(format, data, folder).key == find.outcome.key

        if shows(data):
            (find.folder / "input").write_bytes(minimised(data, shows, format.smaller, seconds))


def keep(finds: list[Find]) -> None:
    """Copy finds to the corpus and list them as owed."""
    owed = json.loads(OWED.read_text(encoding="utf-8"))
    for find in finds:
        entry = f"{find.format}/{find.folder.name}{FORMATS[find.format].suffix}"
        (CORPUS / find.format).mkdir(parents=True, exist_ok=True)
        (CORPUS / entry).write_bytes(find.data)
        owed[entry] = find.outcome.key
    OWED.write_text(json.dumps(dict(sorted(owed.items())), indent=1) + "\n", encoding="utf-8")
