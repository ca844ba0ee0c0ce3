"""python -m psdmc.report.bench_page RESULT.json PAGE.html: write a benchmark's report as one HTML page."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from jinja2 import Environment, FunctionLoader, StrictUndefined

from psdmc.atomic import write_whole
from psdmc.bench.results import BenchResult
from psdmc.bench.run import SCALED
from psdmc.errors import InputError, exit_status_of
from psdmc.reading import read_file
from psdmc.report import bench_plots
from psdmc.report.bench_view import (
    FunctionTable,
    function_tables,
    headlines,
    own_table,
    published_rows,
    quoted_table,
    scaling_rows,
    thread_rows,
)

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
    """The page at `path`; errors as psdmc.atomic.write_whole."""
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
        "colours": bench_plots.COLOURS,
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
        bench_plots.case_plots(case),
        function_tables(case),
        missing,
    )


def _scaling_plots(result: BenchResult) -> tuple[str, ...]:
    if not result.scaling:
        return ()
    return tuple(bench_plots.scaling(result, f) for f in SCALED)


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


def main() -> int:
    """Write the page of the benchmark result that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m psdmc.report.bench_page", description=__doc__)
    parser.add_argument("result", type=Path, help="JSON of python -m psdmc.bench or psdmc bench")
    parser.add_argument("page", type=Path, help="HTML to write")
    options = parser.parse_args()
    return exit_status_of(lambda: write_page(read_result(options.result), options.page))


if __name__ == "__main__":
    sys.exit(main())
