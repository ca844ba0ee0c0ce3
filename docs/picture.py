"""Draws docs/images/speed.svg from the table of docs/benchmarks.md: python docs/picture.py"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "docs/images/speed.svg"
ROBOT = "KR6"
FUNCTIONS = ("inverse dynamics", "forward dynamics", "mass matrix", "regressor")
CELL = re.compile(r"([\d.]+) \(([\d.]+)× / ([\d.]+)×\)")

WIDTH, LEFT, BAR, GAP, TOP = 470, 148, 16, 18, 56
STYLE = """text { font: 14px system-ui, sans-serif; fill: #1b1f24 } .small { font-size: 12px; fill: #57606a }
.psdmc { fill: #3949ab } .CasADi { fill: #8d99ae } .Pinocchio { fill: #c3c9d4 }
@media (prefers-color-scheme: dark) {
text { fill: #e6edf3 } .small { fill: #9aa4b0 }
.psdmc { fill: #8c9eff } .CasADi { fill: #707b8c } .Pinocchio { fill: #4a5361 } }"""


@dataclass(frozen=True, slots=True)
class Bars:
    """One function's times, ns a state."""

    function: str
    psdmc: float
    casadi: float
    pinocchio: float


def table(text: str, robot: str) -> list[Bars]:
    """Times of a robot in the table: psdmc's own, the rivals' from the ratios beside it."""
    rows = [
        [cell.strip() for cell in line.strip("|\n ").split("|")]
        for line in text.splitlines()
        if line.startswith("|")
    ]
    head = next(row for row in rows if row[:2] == ["robot", "inverse dynamics"])
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


def draw(bars: list[Bars]) -> str:
    """The picture as SVG text."""
    longest = max(bar.pinocchio for bar in bars)
    scale = (WIDTH - LEFT - 110) / longest
    parts, y = [], TOP
    for bar in bars:
        parts.append(f'<text x="{LEFT - 10}" y="{y + 30}" text-anchor="end">{bar.function}</text>')
        for name, value in (("psdmc", bar.psdmc), ("CasADi", bar.casadi), ("Pinocchio", bar.pinocchio)):
            length = value * scale
            parts.append(
                f'<rect class="{name}" x="{LEFT}" y="{y}" width="{length:.1f}" height="{BAR}" rx="2"/>'
            )
            label = f"{value:.0f} ns" if name == "psdmc" else f"{name} {value:.0f}"
            parts.append(f'<text class="small" x="{LEFT + length + 6:.1f}" y="{y + 12}">{label}</text>')
            y += BAR + 1
        y += GAP
    title = f"{ROBOT}: nanoseconds a call, less is better"
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y}" role="img" aria-label="{title}">'
        f"<style>{STYLE}</style>"
        f'<text x="0" y="22">{title}</text>'
    )
    return "\n".join([head, *parts, "</svg>", ""])


def main() -> None:
    text = draw(table((ROOT / "docs/benchmarks.md").read_text(encoding="utf-8"), ROBOT))
    if "--print" in sys.argv:
        print(text, end="")
        return
    PICTURE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
