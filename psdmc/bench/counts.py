"""What psdmc's code costs, counted rather than timed: operations on the PROGRAM, instructions under callgrind."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psdmc.bench.build import COUNTED
from psdmc.bench.callgrind import instructions
from psdmc.bench.case import Case
from psdmc.bench.contestant import Contestant
from psdmc.bench.rivals import psdmc_c
from psdmc.errors import InputError, ToolchainError
from psdmc.toolchain.compiler_command import find_compiler

SCHEMA = 1

Counts = dict[str, dict[str, dict[str, float]]]
"""robot -> function -> what is counted -> how many"""


@dataclass(frozen=True, slots=True)
class Baseline:
    """Counts, and the compiler that instruction counts hold for; `without` says why there are none."""

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
            content = json.loads(path.read_text())
            return Baseline(content["compiler"], content["counts"])
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}", "make it with: make bench-save") from None
        except (ValueError, KeyError, TypeError):
            raise InputError(
                f"{path}: not a baseline of counts", "make it anew with: make bench-save"
            ) from None


def count(cases: Sequence[Case], progress: Callable[[str], None] = lambda message: None) -> Baseline:
    """Operations of every function and instructions per state, for each case, factored.

    Instructions are left out, with the reason, where valgrind is missing.
    """
    counts: Counts = {}
    without: str | None = None
    for case in cases:
        progress(f"{case.name}: counting")
        contestants = psdmc_c.factored(case, COUNTED)
        counts[case.name] = _operations(contestants)
        try:
            for (_, symbol), value in instructions(contestants, case.chain).items():
                one = next(c for c in contestants if c.symbol == symbol)
                counts[case.name][one.function][f"instructions {one.layout}"] = round(value, 2)
        except ToolchainError as error:
            without = error.message
    return Baseline(find_compiler().version.splitlines()[0], counts, without)


def _operations(contestants: Sequence[Contestant]) -> dict[str, dict[str, float]]:
    table: dict[str, dict[str, float]] = {}
    for one in contestants:
        row = table.setdefault(one.function, {})
        if one.operations and one.layout != "lanes":
            kind = "" if one.layout == "state" else "batch "
            row[f"{kind}mul"], row[f"{kind}add"] = one.operations
    return table
