"""Time batch calls on several threads at once, to show how speed grows with the number of cores."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from psdmc.bench.contestant import Contestant, Runner
from psdmc.bench.rivals import psdmc_c
from psdmc.bench.states import States

THREADS = (1, 2)
FUNCTIONS = psdmc_c.EXPANDED
TRIALS = 5
PASSES = 30
"""How often each thread goes through all states in a trial: some 20 ms, long compared with starting threads."""


@dataclass(frozen=True, slots=True)
class ThreadTime:
    """ns per state, all threads together."""

    function: str
    layout: str
    threads: int
    ns: float


def measure_threads(contestants: Sequence[Contestant], states: States) -> tuple[ThreadTime, ...]:
    """Time psdmc's batch functions on one and two threads, which share the inputs and have own outputs."""
    return tuple(
        ThreadTime(c.function, c.layout, threads, _ns_per_state(c, states, threads))
        for c in contestants
        if c.layout != "state" and c.rival == "psdmc factored" and c.function in FUNCTIONS
        for threads in THREADS
    )


def _ns_per_state(contestant: Contestant, states: States, threads: int) -> float:
    runners = [Runner(contestant, states) for _ in range(threads)]
    with ThreadPoolExecutor(threads) as pool:
        seconds = []
        for _ in range(TRIALS):
            start = time.perf_counter()
            list(pool.map(_passes, runners))
            seconds.append(time.perf_counter() - start)
    return 1e9 * float(np.median(seconds)) / (PASSES * threads * states.count)


def _passes(runner: Runner) -> None:
    for _ in range(PASSES):
        runner.throughput()
