"""Time of each function for one robot, with Pinocchio's and CasADi's: speed.svg, from the table of docs/benchmarks.md."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pictures.canvas import Canvas

NAME = "speed.svg"
TABLE = Path(__file__).parents[1] / "benchmarks.md"
ROBOT = "KR6"
FUNCTIONS = ("inverse dynamics", "forward dynamics", "mass matrix", "regressor")
CELL = re.compile(r"([\d.]+) \(([\d.]+)× / ([\d.]+)×\)")

LEFT, BAR = 82, 17


@dataclass(frozen=True, slots=True)
class Bars:
    """One function's times, ns per call."""

    function: str
    psdmc: float
    casadi: float
    pinocchio: float


def table(text: str, robot: str) -> list[Bars]:
    """Times of a robot in the table: psdmc's from the cell, the others' from the cell's ratios."""
    rows = [
        [cell.strip() for cell in line.strip("|\n ").split("|")]
        for line in text.splitlines()
        if line.startswith("|")
    ]
    head = next(row for row in rows if row[1:2] == ["inverse dynamics"])
    cells = dict(
        zip(head, next(row for row in rows if row[0] == robot and len(row) == len(head)), strict=True)
    )
    return [_bars(name, cells[name]) for name in FUNCTIONS if name in cells]


def _bars(function: str, cell: str) -> Bars:
    found = CELL.fullmatch(cell)
    if found is None:
        raise ValueError(f"the cell {cell!r} is no 'time (ratio× / ratio×)'")
    own, pinocchio, casadi = (float(value) for value in found.groups())
    return Bars(function, own, own * casadi, own * pinocchio)


def draw() -> str:
    bars = table(TABLE.read_text(encoding="utf-8"), ROBOT)
    title = f"{ROBOT}: nanoseconds per call, shorter is faster"
    canvas = Canvas(76 + len(bars) * 86, f"{title}. {_says(bars)}", title)
    scale = (330 - LEFT) / max(bar.pinocchio for bar in bars)
    for index, bar in enumerate(bars):
        y = 58 + index * 86
        canvas.text(14, y, bar.function, "bold")
        for row, (name, value, style) in enumerate(
            (
                ("psdmc", bar.psdmc, "fla"),
                ("CasADi", bar.casadi, "fgrey"),
                ("Pinocchio", bar.pinocchio, "fgrey"),
            )
        ):
            at = y + 8 + row * (BAR + 2)
            canvas.text(LEFT - 8, at + 13, name, "small ta" if style == "fla" else "small soft", "end")
            canvas.box(LEFT, at, value * scale, BAR, style, 2)
            canvas.text(LEFT + value * scale + 6, at + 13, f"{value:.0f} ns", "small")
    canvas.text(
        14, canvas.height - 12, "One call with one state. Machine and date: Benchmarks.", "small soft"
    )
    return canvas.svg


def _says(bars: list[Bars]) -> str:
    return " ".join(
        f"{bar.function}: psdmc {bar.psdmc:.0f}, CasADi {bar.casadi:.0f}, Pinocchio {bar.pinocchio:.0f}."
        for bar in bars
    )
