"""The cost of psdmc's code by counting: operations on the PROGRAM, instructions under callgrind."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psdmc.bench.build import counted_flags
from psdmc.bench.callgrind import instructions
from psdmc.bench.case import Case
from psdmc.bench.rivals import psdmc_c
from psdmc.errors import InputError, ToolchainError
from psdmc.program.cost import cost
from psdmc.reading import read_file
from psdmc.toolchain.compiler_command import find_compiler

SCHEMA = 1
LARGEST_BASELINE = 16 << 20
"""Bytes of a baseline: that of all robots has 0.1 MB."""

Counts = dict[str, dict[str, dict[str, float]]]
"""robot -> function -> what is counted -> how many"""


@dataclass(frozen=True, slots=True)
class Baseline:
    """Counts, and the compiler that instruction counts are valid for; `without` is the reason where there are none."""

    compiler: str
    counts: Counts
    without: str | None = None

    def to_json(self) -> str:
        content: dict[str, Any] = {"schema": SCHEMA, "compiler": self.compiler, "counts": self.counts}
        return json.dumps(content, indent=1) + "\n"

    @staticmethod
    def read(path: Path) -> Baseline:
        """InputError where the file is missing or not a baseline."""
        try:
            content = json.loads(read_file(path, LARGEST_BASELINE, "make it anew with: make bench-save"))
            return Baseline(content["compiler"], content["counts"])
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}", "make it with: make bench-save") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(
                f"{path}: not a baseline of counts", "make it anew with: make bench-save"
            ) from None


def count(
    cases: Sequence[Case],
    progress: Callable[[str], None] = lambda message: None,
    with_instructions: bool = True,
) -> Baseline:
    """Operations of every function and instructions per state, for each case, factored.

    Instructions are left out, with the reason, where they are not wanted or valgrind is missing.
    """
    counts: Counts = {}
    without = None if with_instructions else "not asked for"
    for case in cases:
        progress(f"{case.name}: counting")
        counts[case.name] = operations(case)
        if with_instructions:
            try:
                _add_instructions(counts[case.name], case)
            except ToolchainError as error:
                without = error.message
    return Baseline(find_compiler().version.splitlines()[0], counts, without)


def operations(case: Case) -> dict[str, dict[str, float]]:
    """Multiplications and additions (with subtractions and divisions) of each function's PROGRAMs."""
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
