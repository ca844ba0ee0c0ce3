"""python -m psdmc.bench.gate compare|save: compare operation and instruction counts with the committed baseline.

If a count has grown, the command fails until the baseline is changed in the same commit. Times are printed, but cannot
fail. Instruction counts are compared only if the compiler is that of the baseline.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psdmc.bench.case import Case
from psdmc.bench.cases import standard_cases
from psdmc.bench.machine import counted_flags
from psdmc.bench.measure import instructions
from psdmc.bench.rivals import psdmc_c
from psdmc.errors import InputError, ToolchainError, exit_status_of
from psdmc.files import make_folder, read_file, write_whole
from psdmc.program.cost import cost
from psdmc.progress import Progress, silent
from psdmc.toolchain.compiler_command import find_compiler

BASELINE = Path("benchmarks") / "baseline.json"

SLACK = 0.002
"""Relative growth of instructions that passes: some depend on where libraries are loaded."""


@dataclass(frozen=True, slots=True)
class Change:
    """An operation or instruction count that differs between the baseline (`before`) and the present code (`after`).
    The value is None on the side that has no such count."""

    robot: str
    function: str
    what: str
    before: float | None
    after: float | None

    @property
    def fails(self) -> bool:
        if self.before is None or self.after is None:
            return True
        slack = SLACK if self.what.startswith("instructions") else 0.0
        return self.after > self.before * (1.0 + slack)

    def __str__(self) -> str:
        if self.before is None:
            verdict = "NEW: not in the baseline"
        elif self.after is None:
            verdict = "GONE: only in the baseline"
        elif self.fails:
            verdict = "GREW"
        else:
            verdict = "fell" if self.after < self.before else "grew by less than counts"
        return f"{self.robot} {self.function}: {self.what} {_shown(self.before)} -> {_shown(self.after)}  {verdict}"


def changes(before: Baseline, after: Baseline) -> Iterator[Change]:
    """Return all counts that differ between the baseline `before` and the present code `after`, robot by robot.
    Instruction counts are compared only if both were made with one compiler version."""
    for robot in after.counts:
        comparable = before.compiler == after.compiler and robot not in after.uncounted
        old_robot, new_robot = before.counts.get(robot, {}), after.counts[robot]
        for function in {**old_robot, **new_robot}:
            old, new = old_robot.get(function, {}), new_robot.get(function, {})
            for what in {**old, **new}:
                if what.startswith("instructions") and not comparable:
                    continue
                if old.get(what) != new.get(what):
                    yield Change(robot, function, what, old.get(what), new.get(what))


def compare(before: Baseline, after: Baseline) -> tuple[str, bool]:
    """The report, and whether the counts pass."""
    found = list(changes(before, after))
    lines = [str(change) for change in found]
    lines += _uncounted_lines(after)
    if before.compiler != after.compiler:
        lines.append(
            f"instructions were not compared: the baseline is of {before.compiler}, this is {after.compiler}"
        )
    failed = [change for change in found if change.fails]
    if failed:
        lines.append(
            f"{len(failed)} counts grew. If that is meant: make bench-save, and commit it with the change"
        )
    elif found:
        lines.append("nothing grew; make bench-save keeps what fell")
    else:
        lines.append("counts are those of the baseline")
    return "\n".join(lines), not failed


def _uncounted_lines(after: Baseline) -> list[str]:
    """The robots whose instructions were not counted, and why; a reason that all share is said once."""
    if len(reasons := set(after.uncounted.values())) == 1 and len(after.uncounted) == len(after.counts):
        return [f"instructions were not counted: {reasons.pop()}"]
    return [f"{robot}: instructions were not counted: {reason}" for robot, reason in after.uncounted.items()]


def main() -> int:
    """Compare the counts with the baseline, or save them as the baseline, as the command line says."""
    parser = argparse.ArgumentParser(prog="python -m psdmc.bench.gate", description=__doc__)
    parser.add_argument("action", choices=("compare", "save"))
    parser.add_argument("names", nargs="*", help="standard robots; all where none is named")
    parser.add_argument("--baseline", type=Path, default=BASELINE, help="default %(default)s")
    options = parser.parse_args()
    if options.action == "save":
        return exit_status_of(lambda: _save(options.baseline, options.names))
    return exit_status_of(lambda: _compare(options))


def _compare(options: argparse.Namespace) -> int:
    before = Baseline.read(options.baseline)
    text, passed = compare(before, _counted(options.names))
    print(text)
    return 0 if passed else 1


def _save(path: Path, names: list[str]) -> int:
    """Save the baseline. Named robots replace theirs. A robot whose instructions could not be counted keeps the counts of
    the baseline. Instruction counts of another compiler are not kept."""
    after = _counted(names)
    before = Baseline.read(path) if path.is_file() else Baseline(after.compiler, {})
    known = before.counts if before.compiler == after.compiler else _without_instructions(before.counts)
    for line in _uncounted_lines(after):
        print(f"warning: {line}", file=sys.stderr)
    for robot in after.uncounted:
        for function, table in known.get(robot, {}).items():
            instructions = {what: value for what, value in table.items() if what.startswith("instructions")}
            after.counts[robot].get(function, {}).update(instructions)
    make_folder(path.parent)
    kept = known if names else {}
    write_whole(path, Baseline(after.compiler, {**kept, **after.counts}).to_json())
    print(f"wrote {path}")
    return 0


def _without_instructions(counts: Counts) -> Counts:
    return {
        robot: {
            function: {what: value for what, value in table.items() if not what.startswith("instructions")}
            for function, table in functions.items()
        }
        for robot, functions in counts.items()
    }


def _counted(names: list[str]) -> Baseline:
    def tell(message: str) -> None:
        print(message, file=sys.stderr, flush=True)

    return count(list(standard_cases(names or None)), tell)


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


SCHEMA = 1
LARGEST_BASELINE = 16 << 20
"""Bytes of a baseline: that of all robots has 0.1 MB."""

Counts = dict[str, dict[str, dict[str, float]]]
"""robot -> function -> what is counted -> how many"""


@dataclass(frozen=True, slots=True)
class Baseline:
    """Operation and instruction counts of all robots and functions, and the compiler with which instructions were
    counted. `uncounted` names the robots without instruction counts, each with the reason."""

    compiler: str
    counts: Counts
    uncounted: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> str:
        content: dict[str, Any] = {"schema": SCHEMA, "compiler": self.compiler, "counts": self.counts}
        return json.dumps(content, indent=1) + "\n"

    @staticmethod
    def read(path: Path) -> Baseline:
        """Read the baseline from its file. Raise InputError if the file is missing or not a baseline."""
        try:
            content = json.loads(read_file(path, LARGEST_BASELINE, "make it anew with: make bench-save"))
            return Baseline(content["compiler"], content["counts"])
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}", "make it with: make bench-save") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(
                f"{path}: not a baseline of counts", "make it anew with: make bench-save"
            ) from None


def count(cases: Sequence[Case], progress: Progress = silent, with_instructions: bool = True) -> Baseline:
    """Count the operations and instructions per state of every function of each robot, for code that psdmc factors into
    few operations.

    Instructions are left out if they are not wanted, or if the compiler or valgrind fails: valgrind 3.19 does not know
    each instruction of AVX. The result then states the reason for each robot.
    """
    counts: Counts = {}
    uncounted: dict[str, str] = {}
    for case in cases:
        progress(f"{case.name}: counting")
        counts[case.name] = operations(case)
        try:
            if with_instructions:
                _add_instructions(counts[case.name], case)
            else:
                uncounted[case.name] = "not asked for"
        except ToolchainError as error:
            uncounted[case.name] = error.message
    return Baseline(find_compiler().version.splitlines()[0], counts, uncounted)


def operations(case: Case) -> dict[str, dict[str, float]]:
    """Return each function's numbers of multiplications and additions (with subtractions and divisions)."""
    table: dict[str, dict[str, float]] = {}
    for name, kernel in psdmc_c.kernels_of(case.model, "factored", case.functions).items():
        single, batch = cost(kernel.single), cost(kernel.batch)
        table[name] = {
            "mul": single.mul,
            "add": single.add + single.div,
            "batch mul": batch.mul,
            "batch add": batch.add + batch.div,
        }
    return table


def _add_instructions(table: dict[str, dict[str, float]], case: Case) -> None:
    contestants = psdmc_c.contestants(case, "factored", case.functions, counted_flags())
    found = instructions(contestants, case.chain)
    for one in contestants:
        value = found[str(one.library), one.symbol]
        table[one.function][f"instructions {one.layout}"] = round(value, 2)


if __name__ == "__main__":
    sys.exit(main())
