"""python -m psdmc.report.bench_page RESULT.json PAGE.html: write a benchmark's report as one HTML page."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psdmc.backends.c.render import environment
from psdmc.bench.results import BenchResult, CaseResult, Measurement
from psdmc.bench.run import SCALED
from psdmc.errors import InputError, exit_status_of
from psdmc.files import read_file, write_whole
from psdmc.functions import RECIPES
from psdmc.report.drawing import Figure, legend_below, svg

OURS = "psdmc factored"
PINOCCHIO = "Pinocchio"
CASADI = "CasADi"

FUNCTION_TITLES = {name: recipe.title[0].upper() + recipe.title[1:] for name, recipe in RECIPES.items()}

Cells = tuple[str, ...]
"""Texts of one row of a table; the template names them."""

LAYOUT_TITLES = {"state": "one state per call", "rows": "batch, rows", "lanes": "batch, lane by lane"}


@dataclass(frozen=True, slots=True)
class FunctionTable:
    """One function's rows as text, one for each library, fastest first. `ours` is true in psdmc's."""

    title: str
    rows: tuple[dict[str, Any], ...]


def headlines(result: BenchResult) -> tuple[tuple[str, tuple[Cells, ...]], ...]:
    """Return a row for every robot: its name, then cells for inverse and for forward dynamics. The cells are psdmc's time
    in ns, and how many times faster it is than Pinocchio and than C code of CasADi. Two more cells are for batch calls,
    by rows and lane by lane, over Pinocchio. Pinocchio's faster algorithm counts."""
    batches = (("state", PINOCCHIO), ("state", CASADI), ("rows", PINOCCHIO), ("lanes", PINOCCHIO))
    rows = []
    for case in result.cases:
        cells = []
        for function in SCALED:
            ours = case.best(OURS, function)
            ratios = (case.ratio(function, layout, over=rival, rival=OURS) for layout, rival in batches)
            cells.append((f"{ours.ns:.0f}" if ours else "–", *(f"{r:.1f}" if r else "–" for r in ratios)))
        rows.append((case.name, tuple(cells)))
    return tuple(rows)


def function_tables(case: CaseResult) -> tuple[FunctionTable, ...]:
    """Return a table of times for each function that was measured on a robot."""
    tables = []
    for function in dict.fromkeys(m.function for m in case.measurements):
        reference = case.best(PINOCCHIO, function)
        own = sorted((m for m in case.measurements if m.function == function), key=lambda m: m.ns)
        rows = tuple(_row(m, reference.ns if reference else None) for m in own)
        tables.append(FunctionTable(FUNCTION_TITLES[function], rows))
    return tuple(tables)


def _row(m: Measurement, reference: float | None) -> dict[str, Any]:
    times = m.times
    return {
        "who": m.label,
        "how": LAYOUT_TITLES[m.layout],
        "operations": "{} + {}".format(*m.operations) if m.operations else "",
        "instructions": f"{m.instructions:.0f}" if m.instructions is not None else "",
        "ns": f"{m.ns:.1f}",
        "spread": f"{times.throughput.low:.1f} – {times.throughput.high:.1f}",
        "latency": f"{times.latency.median:.1f}" if times.latency else "",
        "cold": f"{times.cold.median:,.0f}" if times.cold else "",
        "code": f"{m.code_bytes / 1e3:.1f}" if m.code_bytes is not None else "",
        "worst": f"{times.tail.percentile_99_99:.0f} / {times.tail.worst:.0f}" if times.tail else "",
        "ratio": f"{reference / m.ns:.1f}×" if reference else "",
        "error": f"{m.error:.0e}",
        "ours": m.rival.startswith("psdmc"),
    }


def quoted_table() -> tuple[Cells, ...]:
    """Denso-2022's table 5 as printed."""
    _, inverse, forward = DENSO_TABLE_5[0]
    return tuple(_quoted(*row, inverse, forward) for row in DENSO_TABLE_5)


def own_table(result: BenchResult) -> tuple[Cells, ...]:
    """Return table 5 of Denso-2022 with times of this machine; empty if the Denso was not measured."""
    case = next((case for case in result.cases if case.name == "Denso"), None)
    if case is None:
        return ()
    found = []
    for rival in (OURS, "psdmc expanded", PINOCCHIO, CASADI):
        pair = tuple(case.best(rival, function) for function in SCALED)
        if pair[0] and pair[1]:
            found.append((rival, pair[0].ns, pair[1].ns))
    return tuple(_quoted(rival, i, f, found[0][1], found[0][2]) for rival, i, f in found)


def _quoted(method: str, inverse: float, forward: float, inverse_one: float, forward_one: float) -> Cells:
    """A row of table 5: the library, its times, and their ratios to those of the first row."""
    return (
        method,
        f"{inverse / 1e3:.3g} µs",
        f"{forward / 1e3:.3g} µs",
        f"{inverse / inverse_one:.3g}",
        f"{forward / forward_one:.3g}",
    )


def published_rows(result: BenchResult) -> tuple[Cells, ...]:
    """Return rows with times of inverse and forward dynamics in ns, for robots that the authors published."""
    rows = []
    for case in result.cases:
        theirs = PUBLISHED.get(case.name)
        if theirs is None:
            continue
        seconds = f"{case.derive_seconds:.1f} s" if case.derive_seconds is not None else "–"
        rows.append(
            (
                case.name,
                theirs.source,
                f"{theirs.inverse:.0f} / {theirs.forward:.0f}",
                _pair(case, "psdmc expanded"),
                _pair(case, OURS),
                f"{theirs.derivation:g} s / {seconds}",
            )
        )
    return tuple(rows)


def _pair(case: CaseResult, rival: str) -> str:
    both = tuple(case.best(rival, function) for function in SCALED)
    return " / ".join(f"{m.ns:.0f}" if m else "–" for m in both)


def scaling_rows(result: BenchResult) -> tuple[Cells, ...]:
    """Return rows with the times of inverse and forward dynamics in ns, by number of joints."""
    return tuple(
        (
            str(case.n),
            f"{case.p if case.p is not None else 'not expanded'} / {case.l}",
            f"{case.derive_seconds:.2f} s" if case.derive_seconds is not None else "–",
            f"{case.derive_bytes / 2**20:.0f} MiB" if case.derive_bytes is not None else "–",
            f"{_pair(case, OURS)} ({_operations(case, OURS)})",
            f"{_pair(case, 'psdmc expanded')} ({_operations(case, 'psdmc expanded')})",
            _pair(case, PINOCCHIO),
        )
        for case in result.scaling
    )


def _operations(case: CaseResult, rival: str) -> str:
    both = tuple(case.best(rival, function) for function in SCALED)
    return " / ".join(str(sum(m.operations)) if m and m.operations else "–" for m in both)


def thread_rows(result: BenchResult) -> tuple[tuple[str, str, str, Cells, str], ...]:
    """Return rows with ns per state by number of threads, and the speed-up of the most threads over one."""
    rows = []
    for case in result.cases:
        for function, layout in dict.fromkeys((t.function, t.layout) for t in case.threads):
            own = [t for t in case.threads if (t.function, t.layout) == (function, layout)]
            times = tuple(f"{t.ns:.1f}" for t in own)
            speedup = f"{own[0].ns / own[-1].ns:.2f}×"
            rows.append((case.name, FUNCTION_TITLES[function], LAYOUT_TITLES[layout], times, speedup))
    return tuple(rows)


# Times that the authors of the method published: reports show them without ratios, as machines and inertias differ


@dataclass(frozen=True, slots=True)
class Published:
    """Published times of one robot in ns per call, and of its derivation in s; None if not published."""

    source: str
    inverse: float
    forward: float
    derivation: float | None


PSDM_2021 = "PSDM-2021 (Mech. Mach. Theory 156)"
DENSO_2022 = "Denso-2022, table 5"

PUBLISHED = {
    "Denso": Published(DENSO_2022, 400.0, 630.0, 3.0),
    "KR6": Published(PSDM_2021, 2110.0, 2270.0, 5.3),
    "LBR7": Published(PSDM_2021, 6490.0, 7280.0, 88.0),
}
"""By the benchmark's name of the robot."""


DENSO_TABLE_5 = (
    ("PSDM", 400.0, 630.0),
    ("RNE", 6000.0, 19900.0),
    ("RNE, regressive form", 17200.0, 112000.0),
)
"""Rows of table 5 of the paper Denso-2022: method, and times of inverse and forward dynamics in ns per call."""


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
        "scaling_plots": tuple(scaling(result, f) for f in SCALED) if result.scaling else (),
        "threads": thread_rows(result),
        "colours": COLOURS,
        "busy": [case.name for case in (*result.cases, *result.scaling) if not case.idle],
    }
    template = environment().overlay(autoescape=True).get_template("report/bench.html.jinja")
    return template.render(**view)


def _section(result: BenchResult, index: int) -> RobotSection:
    case = result.cases[index]
    p = "not expanded" if case.p is None else f"{case.p:,} monomials"
    missing = tuple((m.rival, m.reason) for m in (*case.unavailable, *case.wrong))
    return RobotSection(
        case.name,
        f"robot{index}",
        f"{case.n} joints, {p}, {case.l} base parameters; {case.note}; {case.rounds} trials",
        tuple(bars(case, function) for function in SCALED if any(case.of(function))),
        function_tables(case),
        missing,
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
