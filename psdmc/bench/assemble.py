"""Build every contestant of every case, on all cores, before anything is timed."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

from psdmc.bench.build import counted_flags
from psdmc.bench.callgrind import instructions
from psdmc.bench.case import Case
from psdmc.bench.contestant import Contestant, Unavailable
from psdmc.bench.rivals import Entrant
from psdmc.errors import ToolchainError
from psdmc.processes import in_processes


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """One case's contestants, and those that could not be built."""

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
    assembled: list[Assembled] = []
    # What all cases share is built for the first, once, not by several processes at a time.
    for some in (cases[:1], cases[1:]):
        jobs = [(entrant, case, count) for case in some for entrant in entrants]
        entered = iter(in_processes(enter, jobs, os.cpu_count() or 1))
        for case in some:
            progress(f"{case.name}: building")
            entries = [entry for row in islice(entered, len(entrants)) for entry in row]
            assembled.append(_sorted(case, entries, functions))
    return tuple(assembled)


def enter(job: tuple[Entrant, Case, bool]) -> list[Contestant | Unavailable]:
    """One entrant's contestants for one case; with instruction counts where the job asks for them and they are
    possible."""
    entrant, case, count = job
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
