"""Interleaved trials: every contestant in turn, repeatedly, counted only while the machine is idle."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from psdmc.bench.contestant import Runner
from psdmc.bench.machine import IDLE_SHARE, others_share
from psdmc.progress import Step
from psdmc.robot.mechanism import Array

PATIENCE = 3
"""Rounds tried for each that must count; after that busy ones count too, and the result says so."""


@dataclass(frozen=True, slots=True)
class Spread:
    """A figure over several trials: median, quartiles and the best, ns."""

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
    """ns per call over blocks of 64 calls, the clock's own cost subtracted: the worst case for a control loop."""

    median: float
    percentile_99_99: float
    worst: float
    blocks: int


@dataclass(frozen=True, slots=True)
class Times:
    """One contestant's times; latency, tail and cold calls only where it takes one state a call.

    cold  over single calls with nothing in the caches; None where they were not measured
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
    """Times in the runners' order, and whether the machine was idle while they were taken."""

    times: tuple[Times, ...]
    rounds: int
    idle: bool


def measure(
    runners: Sequence[Runner],
    rounds: int,
    progress: Callable[[str], None] = lambda message: None,
    between: Callable[[], None] = lambda: None,
    cold: bool = False,
) -> Measured:
    """Every runner once a round, `rounds` rounds that count; `between` runs before each of them. `cold`: single calls with
    nothing in the caches, too."""
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
    """Memory of twice the largest cache's size, within LEAST and MOST; every page is written, so that it is one of its
    own."""
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
    """Bytes of each function by its name. What a compiler splits off, `name.cold` and the like, counts as the function's.
    Empty where there is no GNU or LLVM nm: the column then stays empty."""
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
    """Bytes of the functions that belong to one; None where none is known."""
    own = [size for name, size in sizes.items() if belongs(name)]
    return sum(own) if own else None
