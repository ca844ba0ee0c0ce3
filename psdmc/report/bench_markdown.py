"""python -m psdmc.report.bench_markdown RESULT.json: print the tables of docs/benchmarks.md from a benchmark's
result."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from psdmc.bench.results import BenchResult, CaseResult
from psdmc.errors import exit_status_of
from psdmc.report.bench_page import OURS, PINOCCHIO, read_result

DYNAMICS = (
    ("inverse_dynamics", "state", "inverse dynamics"),
    ("forward_dynamics", "state", "forward dynamics"),
    ("mass_matrix", "state", "mass matrix"),
    ("regressor", "state", "regressor"),
)
BATCHES = tuple(
    (f"{name}_dynamics", layout, f"{name} dynamics, {layout}")
    for name in ("inverse", "forward")
    for layout in ("rows", "lanes")
)
DERIVATIVES = tuple(
    (f"{name}_dynamics_derivatives", layout, f"derivatives of {name} dynamics{how}")
    for layout, how in (("state", ""), ("rows", ", batch rows"), ("lanes", ", lane by lane"))
    for name in ("inverse", "forward")
)
GRADIENTS = tuple(
    (f"{name}_dynamics_vjp", layout, f"gradient of {name} dynamics{how}")
    for layout, how in (("state", ""), ("rows", ", batch rows"), ("lanes", ", lane by lane"))
    for name in ("inverse", "forward")
)
"""Function, layout and title of the four tables' columns."""


def markdown(result: BenchResult, command: str = "make bench") -> str:
    """Return tables of psdmc's time in ns per state. The numbers in brackets say how many times faster psdmc is than
    Pinocchio, and than C code of CasADi."""
    return "\n".join(_lines(result, command)) + "\n"


def _lines(result: BenchResult, command: str) -> Iterator[str]:
    for columns in (DYNAMICS, BATCHES, DERIVATIVES, GRADIENTS):
        yield "| robot | " + " | ".join(title for _, _, title in columns) + " |"
        yield "|" + "---|" * (len(columns) + 1)
        for case in result.cases:
            cells = (_cell(case, function, layout) for function, layout, _ in columns)
            yield f"| {case.name} | " + " | ".join(cells) + " |"
        yield ""
    machine = result.machine
    yield (
        "ns per state (times faster than Pinocchio's C++ / than CasADi's C, which take one state a call). "
        f"{machine.processor}, one thread, {machine.compiler}, `{machine.flags}`; `{command}`."
    )
    busy = [case.name for case in result.cases if not case.idle]
    if busy:
        yield f"Measured on a busy machine: {', '.join(busy)}."


def _cell(case: CaseResult, function: str, layout: str) -> str:
    ours = case.best(OURS, function, layout)
    if ours is None:
        return "–"
    ratios = (case.ratio(function, layout, over=rival) for rival in (PINOCCHIO, "CasADi"))
    return f"{ours.ns:.1f} ({' / '.join(f'{r:.1f}×' if r else '–' for r in ratios)})"


def main() -> int:
    """Print the tables of the benchmark result that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m psdmc.report.bench_markdown", description=__doc__)
    parser.add_argument("result", type=Path, help="JSON of python -m psdmc.bench or psdmc bench")
    parser.add_argument("--command", default="make bench", help="what is said to have made it")
    options = parser.parse_args()
    return exit_status_of(lambda: print(markdown(read_result(options.result), options.command), end=""))


if __name__ == "__main__":
    sys.exit(main())
