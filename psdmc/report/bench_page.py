"""python -m psdmc.report.bench_page RESULT.json PAGE.html: write a benchmark's report as one HTML page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from jinja2 import Environment, FunctionLoader, StrictUndefined

from psdmc.bench.results import BenchResult, CaseResult, Measurement
from psdmc.bench.run import SCALED
from psdmc.errors import InputError, exit_status_of
from psdmc.files import read_file, write_whole
from psdmc.report.bench_view import (
    FUNCTION_TITLES,
    OURS,
    PINOCCHIO,
    FunctionTable,
    function_tables,
    headlines,
    own_table,
    published_rows,
    quoted_table,
    scaling_rows,
    thread_rows,
)
from psdmc.report.drawing import Figure, legend_below, svg

LARGEST_RESULT = 64 << 20
"""Bytes of a result: the bench of all robots has 0.3 MB."""
COMMAND = "make bench"


@dataclass(frozen=True, slots=True)
class RobotSection:
    """One robot's part of the page."""

    name: str
    anchor: str
    facts: str
    plots: tuple[str, ...]
    tables: tuple[FunctionTable, ...]
    missing: tuple[tuple[str, str], ...]


def write_page(result: BenchResult, path: Path, command: str = COMMAND) -> None:
    """The page at `path`; errors as psdmc.files.write_whole."""
    write_whole(path, page(result, command))


def page(result: BenchResult, command: str = COMMAND) -> str:
    """Return the HTML text of the page. `command` is the command that made the result."""
    view = {
        "result": result,
        "command": command,
        "headlines": headlines(result),
        "robots": [_section(result, index) for index in range(len(result.cases))],
        "quoted": quoted_table(),
        "own": own_table(result),
        "published": published_rows(result),
        "scaling": scaling_rows(result),
        "scaling_plots": _scaling_plots(result),
        "threads": thread_rows(result),
        "colours": COLOURS,
        "busy": [case.name for case in (*result.cases, *result.scaling) if not case.idle],
    }
    return _environment().get_template("report/bench.html.jinja").render(**view)


def _section(result: BenchResult, index: int) -> RobotSection:
    case = result.cases[index]
    p = "not expanded" if case.p is None else f"{case.p:,} monomials"
    missing = tuple((m.rival, m.reason) for m in (*case.unavailable, *case.wrong))
    return RobotSection(
        case.name,
        f"robot{index}",
        f"{case.n} joints, {p}, {case.l} base parameters; {case.note}; {case.rounds} trials",
        case_plots(case),
        function_tables(case),
        missing,
    )


def _scaling_plots(result: BenchResult) -> tuple[str, ...]:
    if not result.scaling:
        return ()
    return tuple(scaling(result, f) for f in SCALED)


def _environment() -> Environment:
    """The environment for HTML: text from a robot's file is escaped."""

    def source(name: str) -> str | None:
        file = resources.files("psdmc.templates").joinpath(name)
        return file.read_text(encoding="utf-8") if file.is_file() else None

    return Environment(
        loader=FunctionLoader(source),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )


def read_result(path: Path) -> BenchResult:
    """Read a benchmark result from JSON. Raise InputError if the file is missing or is no benchmark result."""
    try:
        text = read_file(path, LARGEST_RESULT, "make it with: psdmc bench --json").decode()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}", "make it with: psdmc bench --json") from error
    return BenchResult.from_json(text)


# Plots


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
    """Draw times against the number of joints, for Pinocchio and psdmc's factored and expanded code."""

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


# The command


def main() -> int:
    """Write the page of the benchmark result that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m psdmc.report.bench_page", description=__doc__)
    parser.add_argument("result", type=Path, help="JSON of python -m psdmc.bench or psdmc bench")
    parser.add_argument("page", type=Path, help="HTML to write")
    options = parser.parse_args()
    return exit_status_of(lambda: write_page(read_result(options.result), options.page))


if __name__ == "__main__":
    sys.exit(main())
