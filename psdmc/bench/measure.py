"""Time all compared functions in turn, round by round, and count only rounds in which the machine was otherwise idle.

Also measure the sizes of machine code, and count instructions.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from psdmc.bench.contestant import Contestant, Runner, source
from psdmc.bench.machine import IDLE_SHARE, built, counted_flags, cxx, others_share
from psdmc.bench.states import States
from psdmc.errors import ToolchainError
from psdmc.progress import Progress, Step, silent
from psdmc.robot.mechanism import Array, Mechanism
from psdmc.toolchain.compiler_command import run

PATIENCE = 3
"""Rounds tried for each that must count; after that busy ones count too, and the result says so."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, quartiles and smallest value of the times of one function over several rounds of timing, ns.

    low, high  lower and upper quartile
    best       smallest time
    """

    median: float
    low: float
    high: float
    best: float

    @staticmethod
    def of(values: Sequence[float] | Array) -> Spread:
        low, median, high = np.percentile(values, [25, 50, 75]).tolist()
        return Spread(median, low, high, float(np.min(values)))


@dataclass(frozen=True, slots=True)
class Tail:
    """The slowest calls of one function, which limit a control loop. The values are times per call in ns, in blocks of
    64 calls, without the time of reading the clock.

    percentile_99_99  time that one block in 10,000 exceeds
    blocks            number of blocks
    """

    median: float
    percentile_99_99: float
    worst: float
    blocks: int


@dataclass(frozen=True, slots=True)
class Times:
    """Times of one compared function. The times except throughput are measured only if a call computes one state.

    cold  time of single calls with empty caches; None if not measured
    """

    throughput: Spread
    latency: Spread | None
    tail: Tail | None
    cold: Spread | None = None


@dataclass(slots=True)
class _Trials:
    throughput: list[float] = field(default_factory=list)
    latency: list[float] = field(default_factory=list)
    tail: list[Array] = field(default_factory=list)
    cold: list[Array] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Measured:
    """Times of all compared functions, in the given order, and whether the machine was otherwise idle."""

    times: tuple[Times, ...]
    rounds: int
    idle: bool


def measure(
    runners: Sequence[Runner],
    rounds: int,
    progress: Progress = silent,
    between: Callable[[], None] = lambda: None,
    cold: bool = False,
) -> Measured:
    """Time every compared function once per round, until `rounds` rounds were made while no other program ran. Returns
    the times of each function. If the machine stays busy for PATIENCE times as many rounds, the times of all rounds are
    returned.

    runners  the compared functions, with their states
    between  function that is called before each round
    cold     True: also time single calls with empty caches
    """
    _round(runners)  # caches, branch predictors and the clock speed settle
    quiet: list[list[_Trials]] = []
    noisy: list[list[_Trials]] = []
    while len(quiet) < rounds and len(quiet) + len(noisy) < PATIENCE * rounds:
        progress(Step(f"round {len(quiet) + 1} of {rounds}", len(quiet) / rounds))
        between()
        share = others_share()
        trials = _round(runners)
        if cold:
            _add_cold(runners, trials)
        (quiet if share() < IDLE_SHARE else noisy).append(trials)
    idle = len(quiet) == rounds
    taken = quiet if idle else quiet + noisy
    return Measured(tuple(_times(trials) for trials in zip(*taken, strict=True)), len(taken), idle)


def _round(runners: Sequence[Runner]) -> list[_Trials]:
    trials = []
    for runner in runners:
        if runner.contestant.layout != "state":
            runner.throughput()  # its states are in no cache yet, and a batch call is fast enough to wait for memory
        trial = _Trials([float(np.median(runner.throughput()))])
        if runner.contestant.layout == "state":
            trial.latency.append(float(np.median(runner.latency())))
            trial.tail.append(runner.tail())
        trials.append(trial)
    return trials


def _add_cold(runners: Sequence[Runner], trials: Sequence[_Trials]) -> None:
    """After all others of a round, as nobody finds anything in the caches then."""
    for runner, trial in zip(runners, trials, strict=True):
        if runner.contestant.layout == "state":
            trial.cold.append(runner.cold(CALLS, swept_memory()))


def _times(trials: Sequence[_Trials]) -> Times:
    latency = [value for trial in trials for value in trial.latency]
    blocks = [block for trial in trials for block in trial.tail]
    calls = [own for trial in trials for own in trial.cold]
    return Times(
        throughput=Spread.of([value for trial in trials for value in trial.throughput]),
        latency=Spread.of(latency) if latency else None,
        tail=_tail(np.concatenate(blocks)) if blocks else None,
        cold=Spread.of(np.concatenate(calls)) if calls else None,
    )


def _tail(blocks: Array) -> Tail:
    median, high = np.percentile(blocks, [50, 99.99]).tolist()
    return Tail(median, high, float(blocks.max()), len(blocks))


CACHES = Path("/sys/devices/system/cpu/cpu0/cache")
"""Where Linux describes them."""

CALLS = 25
"""Cold calls per contestant and round: a sweep takes milliseconds."""

LEAST, MOST = 1 << 26, 1 << 28
"""Bytes swept at least, also where the system does not say how large its caches are, and at most."""

UNITS = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}


@cache
def swept_memory() -> Array:
    """Return an array twice as large as the largest cache of the machine, within the limits LEAST and MOST (bytes). The
    benchmark reads this array to empty the caches."""
    largest = max(map(_bytes, CACHES.glob("index*/size")), default=0)
    return np.ones(min(max(2 * largest, LEAST), MOST) // 8)


def _bytes(size: Path) -> int:
    """The number in a file such as "32768K"; zero where it holds none."""
    text = size.read_text(encoding="ascii").strip()
    number, unit = text.rstrip("KMG"), text[-1:]
    return int(number) * UNITS.get(unit, 1) if number.isdecimal() else 0


CODE = frozenset("tTwW")
"""nm's letters for functions."""


def code_sizes(library: Path) -> dict[str, int]:
    """Return the size in bytes of each C function's machine code in a library, by name; empty if there is no GNU or
    LLVM nm. A compiler may move part of a function into another symbol, such as `name.cold`; its size is added to that
    of the function."""
    nm = shutil.which("nm")
    if nm is None:
        return {}
    command = [nm, "--print-size", "--defined-only", str(library)]
    said = subprocess.run(command, capture_output=True, text=True, check=False, errors="replace").stdout
    found: dict[str, int] = {}
    for line in said.splitlines():
        words = line.split()
        if len(words) == 4 and words[2] in CODE:
            name = words[3].partition(".")[0]
            found[name] = found.get(name, 0) + int(words[1], 16)
    return found


def code_bytes(sizes: Mapping[str, int], belongs: Callable[[str], bool]) -> int | None:
    """Return the size in bytes of all C functions that belong to one function; None if none is known."""
    own = [size for name, size in sizes.items() if belongs(name)]
    return sum(own) if own else None


# Instructions per state, as callgrind counts them. Other work on the machine does not change the counts.


COUNTED_STATES = 512
"""Some angles take glibc's slow paths, the others are alike."""

COUNTED_SEED = 512


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
    states = States.random(chain, COUNTED_STATES, COUNTED_SEED)
    found: dict[tuple[str, str], float] = {}
    for library in dict.fromkeys(c.library for c in contestants):
        own = [c for c in contestants if c.library == library]
        totals = _counted(library, own, states)
        found |= {
            (str(library), c.symbol): total / COUNTED_STATES for c, total in zip(own, totals, strict=True)
        }
    return found


def _counted(library: Path, contestants: Sequence[Contestant], states: States) -> list[int]:
    command = [cxx(), "-std=c++17", *counted_flags(), "counter.cpp", "-o", "counter", "-ldl"]
    counter = built("counter", command, {name: source(name) for name in ("counter.cpp", "loops.hpp")})
    with tempfile.TemporaryDirectory() as folder:
        jobs = [_job(c, states, Path(folder)) for c in contestants]
        (Path(folder) / "jobs.txt").write_text("\n".join(jobs) + "\n")
        (Path(folder) / "robot.txt").write_text(contestants[0].robot or "")
        watched = (
            "--toggle-collect=*_throughput",
            "--dump-after=*_throughput",
            "--callgrind-out-file=counts",
        )
        given = (str(counter), str(library), "robot.txt", "jobs.txt")
        run([valgrind(), "--tool=callgrind", *watched, *given], "callgrind", folder)
        return [_total(Path(folder) / f"counts.{k + 1}") for k in range(len(contestants))]


def _job(contestant: Contestant, states: States, folder: Path) -> str:
    """One line for counter.cpp, and the file of states that it names."""
    name = f"{contestant.function}_{contestant.lanes}_{contestant.convention}.bin"
    (folder / name).write_bytes(
        np.concatenate(states.inputs(contestant.function, contestant.lanes, contestant.convention)).tobytes()
    )
    more = states.more(contestant.function)
    sizes = (states.nq, states.nv, more, contestant.outputs, COUNTED_STATES, COUNTED_STATES)
    return f"{contestant.symbol} {' '.join(map(str, sizes))} {name}"


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
