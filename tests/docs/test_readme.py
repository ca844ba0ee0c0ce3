"""README stays short, and its figures are those of docs/benchmarks.md."""

from __future__ import annotations

import re

from blocks import ROOT

MOST_LINES = 120
README = (ROOT / "README.md").read_text(encoding="utf-8")
FIGURE = re.compile(r"[\d.]+ \([\d.]+×")


def figures(line: str) -> list[str]:
    """Time and ratio to Pinocchio in each cell of a table's row."""
    return FIGURE.findall(line)


def test_readme_is_short() -> None:
    assert len(README.splitlines()) < MOST_LINES


def test_the_figures_are_those_of_the_benchmarks() -> None:
    measured = (ROOT / "docs/benchmarks.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in README.splitlines() if figures(line)]

    assert rows
    for row in rows:
        robot = row.split("|")[1].split()[-1]
        known = {figure for line in measured if line.startswith(f"| {robot} ") for figure in figures(line)}
        assert set(figures(row)) <= known, robot
