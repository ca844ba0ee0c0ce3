"""Build every contestant of every case, on all cores, before anything is timed."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace

from psdmc.bench.build import counted_flags
from psdmc.bench.callgrind import instructions
from psdmc.bench.case import Case
from psdmc.bench.contestant import Contestant, Unavailable
from psdmc.bench.rivals import Entrant
from psdmc.errors import ToolchainError


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """One case's contestants, and who could not come."""

    case: Case
    contestants: tuple[Contestant, ...]
    unavailable: tuple[Unavailable, ...]


def assemble(
    cases: Sequence[Case],
    entrants: Sequence[Entrant],
    functions: Sequence[str] | None,
    count: bool,
    progress: Callable[[str], None],
) -> tuple[Assembled, ...]:
    """Contestants of every case, in order.

    functions  names to keep; None: all
    count      whether to count instructions too, which compiles everything once more
    """
    with _pool(len(cases)) as pool:
        futures: list[list[Future[list[Contestant | Unavailable]]]] = []
        for case in cases:
            futures.append([pool.submit(enter, entrant, case, count) for entrant in entrants])
            if len(futures) == 1:  # what all cases share is built once, not by several processes at a time
                [future.result() for future in futures[0]]
        assembled = []
        for case, row in zip(cases, futures, strict=True):
            progress(f"{case.name}: building")
            entries = [entry for future in row for entry in future.result()]
            assembled.append(_sorted(case, entries, functions))
    return tuple(assembled)


def _pool(cases: int) -> Executor:
    """Processes, because lowering is Python; threads do for one case, where compilers do most of the work."""
    if cases == 1:
        return ThreadPoolExecutor(os.cpu_count())
    return ProcessPoolExecutor(os.cpu_count(), mp_context=multiprocessing.get_context("spawn"))


def enter(entrant: Entrant, case: Case, count: bool) -> list[Contestant | Unavailable]:
    """One entrant's contestants, with instruction counts where wanted and possible."""
    entries = list(entrant.contestants(case))
    if not count or not entrant.counted:
        return entries
    counts = _instructions(entrant, case)
    return [
        replace(entry, instructions=counts.get((entry.symbol, entry.layout)))
        if isinstance(entry, Contestant)
        else entry
        for entry in entries
    ]


def _instructions(entrant: Entrant, case: Case) -> dict[tuple[str, str], float]:
    """By symbol and layout; empty where valgrind is missing or fails: the column then stays empty."""
    entries = [entry for entry in entrant.contestants(case, counted_flags()) if isinstance(entry, Contestant)]
    try:
        found = instructions(entries, case.chain)
    except ToolchainError:
        return {}
    return {(e.symbol, e.layout): found[str(e.library), e.symbol] for e in entries}


def _sorted(
    case: Case, entries: Sequence[Contestant | Unavailable], functions: Sequence[str] | None
) -> Assembled:
    contestants = [e for e in entries if isinstance(e, Contestant)]
    wanted = [c for c in contestants if functions is None or c.function in functions]
    return Assembled(case, tuple(wanted), tuple(e for e in entries if isinstance(e, Unavailable)))
