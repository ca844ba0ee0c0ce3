"""Plots of the benchmark as SVG elements in the page. They load nothing from the network, keep text as text, and use
the page's colours."""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.bench.results import BenchResult, CaseResult, Measurement
from psdmc.bench.run import SCALED
from psdmc.report.bench_view import FUNCTION_TITLES, OURS, PINOCCHIO
from psdmc.report.drawing import Figure, legend_below, svg

WIDTH = 5.2
"""inches: narrow, so that labels stay readable on a phone."""

COLOURS = {"psdmc": "#2a9d8f", "Pinocchio": "#e07a3f", "CasADi": "#5b7db1", "MuJoCo": "#9a78b0"}


def bars(case: CaseResult, function: str) -> str:
    """Draw the time per state of each library for one function and robot, for calls with one state."""
    shown = sorted(case.of(function), key=lambda m: m.ns)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        places = range(len(shown))
        axes.barh(places, [m.ns for m in shown], color=[_colour(m) for m in shown], height=0.7)
        axes.set_yticks(places, [m.label for m in shown])
        axes.invert_yaxis()
        longest = max(m.ns for m in shown)
        axes.set_xlim(right=longest * 1.22)
        for place, m in zip(places, shown, strict=True):
            axes.text(m.ns + 0.015 * longest, place, f"{m.ns:.0f} ns", va="center")
        axes.set_title(f"{FUNCTION_TITLES[function]}, {case.name}", loc="left", fontsize=11)
        axes.set_xlabel("time of one call, ns (median)")

    return svg(draw, (WIDTH, 0.8 + 0.3 * len(shown)), f"times of {FUNCTION_TITLES[function]}, {case.name}")


def scaling(result: BenchResult, function: str) -> str:
    """Draw times against the number of joints, for Pinocchio and for psdmc's two forms of code (factored and
    expanded)."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for rival, line in ((OURS, "-o"), ("psdmc expanded", "--s"), (PINOCCHIO, "-^")):
            points = [(case.n, best.ns) for case in result.scaling if (best := case.best(rival, function))]
            if points:
                colour = COLOURS["psdmc" if rival.startswith("psdmc") else rival]
                axes.plot(*zip(*points, strict=True), line, color=colour, label=rival)
        axes.set_yscale("log")
        axes.set_xlabel("number of joints")
        axes.set_ylabel("time of one call, ns")
        axes.set_title(f"{FUNCTION_TITLES[function]} of the LBR7, cut to n joints", loc="left", fontsize=11)
        axes.set_xticks(sorted({case.n for case in result.scaling}))
        legend_below(axes, 3)

    return svg(draw, (WIDTH, 3.2), f"times of {FUNCTION_TITLES[function]} by number of joints")


def _colour(measurement: Measurement) -> str:
    return next((c for name, c in COLOURS.items() if measurement.rival.startswith(name)), "#888888")


def case_plots(case: CaseResult, functions: Sequence[str] = SCALED) -> tuple[str, ...]:
    """Draw a bar plot for each of the functions that was measured on a robot."""
    return tuple(bars(case, function) for function in functions if any(case.of(function)))
