"""python -m psdmc.bench.legged [NAME ...] [--functions NAME ...] [--rounds N]: time derivatives and matrices of robots
with legs.

The inertias are those of the robot files. The benchmark times calls for one state, and psdmc's batches.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from psdmc.bench import ROUNDS
from psdmc.bench.case import Case
from psdmc.bench.cases import LEGGED, legged_cases
from psdmc.bench.results import BenchResult, CaseResult
from psdmc.bench.run import Settings, run
from psdmc.errors import exit_status_of
from psdmc.files import write_whole
from psdmc.progress import on_standard_error

OURS, PINOCCHIO, CASADI = RIVALS = "psdmc factored", "Pinocchio header-only", "CasADi"

THEIRS = {
    "inverse_dynamics": "inverse_dynamics",
    "forward_dynamics": "forward_dynamics",
    "inverse_dynamics_derivatives": "inverse_dynamics_derivatives",
    "forward_dynamics_derivatives": "forward_dynamics_derivatives",
    "inverse_dynamics_vjp": "inverse_dynamics_derivatives",
    "forward_dynamics_vjp": "forward_dynamics_derivatives",
    "mass_matrix": "mass_matrix",
    "mass_matrix_inverse": "mass_matrix_inverse",
    "regressor": "regressor",
}
"""The functions that are measured, and what rivals compute in their place: they have no gradient without the matrices."""

HEAD = ("function", "operations", "code, kB", "psdmc, ns", "Pinocchio", "CasADi", "rows", "lanes")


def main() -> int:
    """Run the benchmark with the options of the command line, and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m psdmc.bench.legged", description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(LEGGED)}; all where none is named")
    parser.add_argument(
        "--functions", nargs="+", choices=tuple(THEIRS), default=tuple(THEIRS), help="all by default"
    )
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="trials that count (default %(default)s)")
    parser.add_argument("--json", type=Path, help="write everything measured there")
    options = parser.parse_args()
    return exit_status_of(lambda: _measure(options))


def _measure(options: argparse.Namespace) -> int:
    cases = list(legged_cases(tuple(options.functions), options.names, on_standard_error))
    result = run(cases, Settings(rounds=options.rounds, rivals=RIVALS), on_standard_error)
    print(as_text(result, cases))
    if options.json:
        write_whole(options.json, result.to_json())
    return 1 if result.wrong else 0


def as_text(result: BenchResult, cases: Sequence[Case]) -> str:
    """Return the results as text, with a table for each robot. A row has psdmc's time for one state. The times of other
    libraries and of psdmc's batch calls are given as multiples of psdmc's time."""
    machine = result.machine
    lines = [f"{machine.processor}, {machine.compiler}, {machine.flags}"]
    for case, found in zip(cases, result.cases, strict=True):
        idle = "" if found.idle else "; MACHINE BUSY: times are not reliable"
        lines += [
            "",
            f"{found.name}: nv {case.chain.nv}; {found.note}; {found.rounds} trials{idle}",
            _line(HEAD),
        ]
        lines += [_line(row) for row in _rows(found)]
        lines += [
            f"  not measured: {each.rival}: {each.reason}" for each in (*found.unavailable, *found.wrong)
        ]
    return "\n".join(lines)


def _rows(found: CaseResult) -> Iterator[tuple[str, ...]]:
    for function, theirs in THEIRS.items():
        own = found.best(OURS, function)
        if own is None:
            continue
        rivals = (found.best(rival, theirs) for rival in (PINOCCHIO, CASADI))
        batches = (found.best(OURS, function, layout) for layout in ("rows", "lanes"))
        yield (
            function,
            str(sum(own.operations or (0, 0))),
            "" if own.code_bytes is None else f"{own.code_bytes / 1e3:.1f}",
            f"{own.ns:.0f}",
            *("" if each is None else f"{each.ns / own.ns:.1f}" for each in rivals),
            *("" if each is None else f"{each.ns / own.ns:.2f}" for each in batches),
        )


def _line(row: Sequence[str]) -> str:
    return f"  {row[0]:<30}" + "".join(f"{cell:>12}" for cell in row[1:])


if __name__ == "__main__":
    sys.exit(main())
