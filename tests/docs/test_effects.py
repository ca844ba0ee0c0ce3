"""The operation counts that docs/factored.md shows are those that docs/effects.py prints today."""

from __future__ import annotations

import re
import subprocess
import sys

from blocks import ROOT


def column(document: str, robot: str, first: str) -> dict[str, int]:
    """A robot's column of the table that has a row starting with `first`."""
    lines = (ROOT / document).read_text(encoding="utf-8").splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f"| {first}"))
    cells = [[cell.strip() for cell in line.strip("| ").split("|")] for line in lines[start - 2 :]]
    place = cells[0].index(robot) + (1 if len(cells[0]) < len(cells[2]) else 0)
    rows = (row for row in cells[2:] if len(row) > place)
    return {row[0]: int(row[place]) for row in rows if row[place].isdigit()}


def test_tables_are_what_the_script_prints():
    words = [sys.executable, str(ROOT / "docs" / "effects.py"), "choices", "KR6"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    printed = {label: int(count) for label, count in re.findall(r"^  (\S.*?) +(\d+)$", said, re.MULTILINE)}

    shown = column("docs/factored.md", "KR6", "the file's frames")

    assert shown == printed, said
