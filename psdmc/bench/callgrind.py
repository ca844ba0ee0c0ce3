"""Count the instructions per state with callgrind. Other work on the machine does not change the counts."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from psdmc.bench.build import built, counted_flags, cxx
from psdmc.bench.contestant import Contestant, source
from psdmc.bench.states import States
from psdmc.errors import ToolchainError
from psdmc.robot.mechanism import Mechanism
from psdmc.toolchain.compiler_command import run

STATES = 512
"""States counted. Some angles take glibc's slow paths, the others are alike."""

SEED = 512


def valgrind() -> str:
    """Return the command of valgrind. Raise ToolchainError if it is not installed."""
    if shutil.which("valgrind") is None:
        raise ToolchainError("valgrind was not found", "install it (Debian: apt install valgrind)")
    return "valgrind"


def instructions(contestants: Sequence[Contestant], chain: Mechanism) -> dict[tuple[str, str], float]:
    """Count the instructions per state of each compared function, and return the counts by (library, C name). The few
    instructions of the loop that calls the function are included.

    contestants  the compared functions, compiled with counted_flags(); valgrind runs once for each of their libraries
    """
    states = States.random(chain, STATES, SEED)
    found: dict[tuple[str, str], float] = {}
    for library in dict.fromkeys(c.library for c in contestants):
        own = [c for c in contestants if c.library == library]
        totals = _counted(library, own, states)
        found |= {(str(library), c.symbol): total / STATES for c, total in zip(own, totals, strict=True)}
    return found


def _counted(library: Path, contestants: Sequence[Contestant], states: States) -> list[int]:
    command = [cxx(), "-std=c++17", *counted_flags(), "counter.cpp", "-o", "counter", "-ldl"]
    counter = built("counter", command, {name: source(name) for name in ("counter.cpp", "loops.hpp")})
    with tempfile.TemporaryDirectory() as folder:
        jobs = [_job(c, states, Path(folder)) for c in contestants]
        (Path(folder) / "jobs.txt").write_text("\n".join(jobs) + "\n")
        (Path(folder) / "robot.txt").write_text(contestants[0].robot or "")
        watched = [
            "--toggle-collect=*_throughput",
            "--dump-after=*_throughput",
            "--callgrind-out-file=counts",
        ]
        words = [
            valgrind(),
            "--tool=callgrind",
            *watched,
            str(counter),
            str(library),
            "robot.txt",
            "jobs.txt",
        ]
        run(words, "callgrind", folder)
        return [_total(Path(folder) / f"counts.{k + 1}") for k in range(len(contestants))]


def _job(contestant: Contestant, states: States, folder: Path) -> str:
    """One line for counter.cpp, and the file of states that it names."""
    name = f"{contestant.function}_{contestant.lanes}_{contestant.convention}.bin"
    (folder / name).write_bytes(
        np.concatenate(states.inputs(contestant.function, contestant.lanes, contestant.convention)).tobytes()
    )
    more = states.more(contestant.function)
    return f"{contestant.symbol} {states.nq} {states.nv} {more} {contestant.outputs} {STATES} {STATES} {name}"


def _total(dump: Path) -> int:
    """Instructions between two dumps."""
    found = (
        re.search(r"^(?:totals|summary): (\d+)", dump.read_text(), re.MULTILINE) if dump.is_file() else None
    )
    if found is None:
        raise ToolchainError(
            f"callgrind wrote no counts to {dump.name}", "try it by hand: valgrind --tool=callgrind"
        )
    return int(found[1])
