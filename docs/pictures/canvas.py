"""An SVG picture, 400 units wide: boxes, arrows and text in colours that follow the reader's light or dark scheme.

A picture is one file with an opaque card behind it, so that it can be read on any page: GitHub, PyPI and Sphinx show an
SVG as an image, whose media query follows the system and not the page's own switch."""

from __future__ import annotations

from html import escape
from itertools import pairwise
from math import atan2, cos, degrees, hypot, sin

WIDTH = 400
SMALLEST = 12.5
"""Units of the smallest text: one unit is a pixel on a telephone."""

STYLE = """text { font: 14px system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; fill: var(--ink) }
svg { --ink: #1b1f24; --soft: #57606a; --line: #6e7781; --card: #ffffff; --edge: #d0d7de; --box: #f3f5f8;
 --a: #3949ab; --b: #b3541e; --c: #1a7f4b; --a-box: #e4e8fb; --b-box: #fbe9dd; --c-box: #dff3e7; --grey: #9aa5b4 }
@media (prefers-color-scheme: dark) {
svg { --ink: #e6edf3; --soft: #aab4bf; --line: #8b949e; --card: #14171c; --edge: #343b44; --box: #20252d;
 --a: #9fa8ff; --b: #f0a36f; --c: #63c990; --a-box: #262c52; --b-box: #43291a; --c-box: #17382a; --grey: #657080 } }
.title { font-weight: 600; font-size: 15px } .small { font-size: 12.5px } .soft { fill: var(--soft) }
.code { font-family: ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace; font-size: 12.5px }
.it { font-style: italic } .bold { font-weight: 600 }
.ta { fill: var(--a) } .tb { fill: var(--b) } .tc { fill: var(--c) }
.card { fill: var(--card); stroke: var(--edge) } .box { fill: var(--box); stroke: var(--line) }
.abox { fill: var(--a-box); stroke: var(--a) } .bbox { fill: var(--b-box); stroke: var(--b) }
.cbox { fill: var(--c-box); stroke: var(--c) } .hidden { fill: none; stroke: none }
.line { fill: none; stroke: var(--line); stroke-width: 1.6 } .la { fill: none; stroke: var(--a); stroke-width: 2 }
.lb { fill: none; stroke: var(--b); stroke-width: 2 } .lc { fill: none; stroke: var(--c); stroke-width: 2 }
.dash { stroke-dasharray: 5 4 }
.fline { fill: var(--line) } .fla { fill: var(--a) } .flb { fill: var(--b) } .flc { fill: var(--c) }
.fgrey { fill: var(--grey) } .link { fill: var(--box); stroke: var(--line); stroke-width: 1.6 }"""


class Canvas:
    """Collects elements; `svg` is the picture's text. Shapes have a class of STYLE."""

    def __init__(self, height: float, says: str, title: str = "") -> None:
        self.height = height
        self.says = says
        self.parts: list[str] = []
        self.texts: list[tuple[float, float, float, str]] = []
        """Each text's left and right end as estimated, its baseline and the text."""
        if title:
            self.text(14, 27, title, "title")

    def text(self, x: float, y: float, words: str, style: str = "", anchor: str = "start") -> None:
        """Words at a baseline; anchor start, middle or end."""
        size = 0.62 if "code" in style else 0.56 if "title" in style or "bold" in style else 0.53
        wide = (
            size
            * len(words)
            * (12.5 if "small" in style or "code" in style else 15 if "title" in style else 14)
        )
        left = x - {"start": 0.0, "middle": wide / 2, "end": wide}[anchor]
        self.texts.append((left, left + wide, y, words))
        where = "" if anchor == "start" else f' text-anchor="{anchor}"'
        named = f' class="{style}"' if style else ""
        self.parts.append(f'<text x="{_n(x)}" y="{_n(y)}"{where}{named}>{escape(words)}</text>')

    def box(
        self, x: float, y: float, wide: float, high: float, style: str = "box", round_: float = 5
    ) -> None:
        self.parts.append(
            f'<rect class="{style}" x="{_n(x)}" y="{_n(y)}" width="{_n(wide)}" height="{_n(high)}" rx="{_n(round_)}"/>'
        )

    def path(self, data: str, style: str) -> None:
        self.parts.append(f'<path class="{style}" d="{data}"/>')

    def circle(self, x: float, y: float, radius: float, style: str) -> None:
        self.parts.append(f'<circle class="{style}" cx="{_n(x)}" cy="{_n(y)}" r="{_n(radius)}"/>')

    def line(self, points: list[tuple[float, float]], style: str = "line") -> None:
        self.path("M" + "L".join(f"{_n(x)} {_n(y)}" for x, y in points), style)

    def arrow(self, points: list[tuple[float, float]], style: str = "line", head: float = 8) -> None:
        """A line through the points with a head at the last; it ends inside the head."""
        (x0, y0), (x, y) = list(pairwise(points))[-1]
        length = hypot(x - x0, y - y0)
        back = (x - (x - x0) / length * head * 0.8, y - (y - y0) / length * head * 0.8)
        self.line([*points[:-1], back], style)
        self._head(x, y, atan2(y - y0, x - x0), style.split()[0], head)

    def arc(self, x: float, y: float, radius: float, start: float, end: float, style: str = "line") -> None:
        """An arc with a head at its end, angles in rad, clockwise on the screen where they grow."""
        at, to = (
            (x + radius * cos(start), y + radius * sin(start)),
            (x + radius * cos(end), y + radius * sin(end)),
        )
        far, sweep = int(abs(end - start) > 3.1416), int(end > start)
        self.path(
            f"M{_n(at[0])} {_n(at[1])}A{_n(radius)} {_n(radius)} 0 {far} {sweep} {_n(to[0])} {_n(to[1])}",
            style,
        )
        turned = end + (1.35 if sweep else -1.35)
        self._head(*to, turned, style.split()[0], 8)

    def _head(self, x: float, y: float, angle: float, style: str, head: float) -> None:
        self.parts.append(
            f'<path class="f{style}" transform="translate({_n(x)} {_n(y)}) rotate({_n(degrees(angle))})"'
            f' d="M0 0L{_n(-head)} {_n(-head * 0.45)}V{_n(head * 0.45)}Z"/>'
        )

    @property
    def svg(self) -> str:
        """The picture as the text of an SVG file."""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {_n(self.height)}" width="{WIDTH * 1.4:.0f}"'
            f' height="{_n(self.height * 1.4)}" role="img" aria-label="{escape(self.says)}">'
        )
        card = f'<rect class="card" x=".5" y=".5" width="{WIDTH - 1}" height="{_n(self.height - 1)}" rx="8"/>'
        return "\n".join([head, f"<style>{STYLE}</style>", card, *self.parts, "</svg>", ""])


def _n(value: float) -> str:
    """A coordinate with at most a decimal."""
    return f"{value:.1f}".removesuffix(".0")
