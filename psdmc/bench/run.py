"""A benchmark run: compile all libraries, compare results with the Newton-Euler recursion in NumPy, time them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from psdmc.bench import ROUNDS, SEED
from psdmc.bench.case import Case
from psdmc.bench.contestant import Contestant, Runner, Unavailable
from psdmc.bench.machine import counted_flags, this_machine, versions
from psdmc.bench.measure import Times, instructions, measure
from psdmc.bench.results import BenchResult, CaseResult, Measurement, ThreadTime
from psdmc.bench.rivals import EVERYONE, Entrant, psdmc_c
from psdmc.bench.states import COUNT, States, output_sizes
from psdmc.errors import ToolchainError
from psdmc.functions import RECIPES
from psdmc.progress import Progress, silent, within
from psdmc.recipes.recipe import Needs
from psdmc.robot.mechanism import Array
from psdmc.workers import in_processes

SCALED = psdmc_c.EXPANDED
SCALED_RIVALS = ("psdmc factored", "psdmc expanded", "Pinocchio")
SCALED_ROUNDS = 3
"""Trials of what is shown against the number of joints."""


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of a benchmark run.

    rounds     number of rounds of timing; each function is timed once in a round
    states     number of random states per round
    seed       seed of the random states
    rivals     names of the libraries to run; None: all
    functions  names of the functions to measure; None: all
    count      whether to count instructions with callgrind
    threads    whether to time batch calls on one and two threads
    cold       whether to time single calls with empty caches
    """

    rounds: int = ROUNDS
    states: int = COUNT
    seed: int = SEED
    rivals: tuple[str, ...] | None = None
    functions: tuple[str, ...] | None = None
    count: bool = False
    threads: bool = False
    cold: bool = False

    def entrants(self) -> tuple[Entrant, ...]:
        return tuple(e for e in EVERYONE if self.rivals is None or e.name in self.rivals)


def run(
    cases: Sequence[Case],
    settings: Settings = Settings(),
    progress: Progress = silent,
    scaling: Sequence[Case] = (),
) -> BenchResult:
    """Run the benchmark for all robots, and return its results. Libraries that cannot be built are listed with the
    reason. Functions with wrong results are listed and not timed.

    scaling  one robot with more and more joints; only some libraries and functions are measured for it
    """
    results = run_cases(cases, settings, progress)
    scaled = Settings(
        min(settings.rounds, SCALED_ROUNDS), settings.states, settings.seed, SCALED_RIVALS, SCALED
    )
    grown = run_cases(scaling, scaled, progress)
    return BenchResult(this_machine(), versions(), settings.seed, settings.states, results, grown)


def run_cases(cases: Sequence[Case], settings: Settings, progress: Progress) -> tuple[CaseResult, ...]:
    """Compile the libraries for all robots, then measure one robot after the other."""
    if not cases:
        return ()
    everyone = assemble(cases, settings.entrants(), settings.functions, settings.count, progress)
    return tuple(run_case(assembled, settings, progress) for assembled in everyone)


def run_case(assembled: Assembled, settings: Settings, progress: Progress) -> CaseResult:
    """Check and time the libraries' functions for one robot."""
    case = assembled.case
    progress(f"{case.name}: checking")
    right, errors, wrong = checked(case, assembled.contestants, settings.seed + 1)
    states = States.random(case.chain, settings.states, settings.seed)
    runners = [Runner(contestant, states) for contestant in right]

    def move() -> None:
        states.move()
        for runner in runners:
            runner.move()

    measured = measure(runners, settings.rounds, within(case.name, progress), move, settings.cold)
    return CaseResult(
        name=case.name,
        note=case.note,
        n=case.n,
        p=case.model.p,
        l=case.model.l,
        derive_seconds=case.derive_seconds,
        derive_bytes=case.derive_bytes,
        measurements=tuple(
            _measurement(c, error, times)
            for c, error, times in zip(right, errors, measured.times, strict=True)
        ),
        unavailable=assembled.unavailable,
        wrong=wrong,
        rounds=measured.rounds,
        idle=measured.idle,
        threads=_measure_threads(right, states) if settings.threads else (),
    )


def _measurement(c: Contestant, error: float, times: Times) -> Measurement:
    counted = (c.operations, c.instructions, c.code_bytes)
    return Measurement(c.rival, c.variant, c.function, c.layout, error, times, *counted)


def checked(
    case: Case, contestants: Sequence[Contestant], seed: int
) -> tuple[list[Contestant], list[float], tuple[Unavailable, ...]]:
    """Return three lists: the functions whose outputs agree with reference values, their relative errors, and the other
    functions with a text on what is wrong."""
    drawn: dict[int, States] = {}
    right: list[Contestant] = []
    errors: list[float] = []
    wrong: list[Unavailable] = []
    for contestant in contestants:
        count = checked_states(contestant.outputs)
        states = drawn.setdefault(count, States.random(case.chain, count, seed))
        error = disagreement(Runner(contestant, states), states)
        if error <= tolerance(contestant.function, states):
            right.append(contestant)
            errors.append(error)
        else:
            what = f"{contestant.label}, {contestant.function} ({contestant.layout})"
            wrong.append(Unavailable(what, f"wrong results: relative error {error:.1e}, so it was not timed"))
    return right, errors, tuple(wrong)


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """For one robot, the compiled functions of all libraries, and the libraries that could not be built."""

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
    """Compile the libraries for every robot, and return the compiled functions robot by robot.

    entrants   the libraries
    functions  names of the functions to keep; None: all
    count      whether to count instructions; all libraries are then compiled a second time with other flags
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
    """Return one library's compiled functions for one robot. If the job asks for it and the library permits it, the
    functions have instruction counts.

    job  the library, the robot, and whether instructions are counted
    """
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
    """Count the instructions, by symbol and layout. The result is empty if valgrind is missing or fails."""
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


# Batch calls on several threads at once, to show how speed grows with the number of cores


THREADS = (1, 2)
TRIALS = 5
PASSES = 30
"""How often each thread goes through all states in a trial: some 20 ms, long compared with starting threads."""


def _measure_threads(contestants: Sequence[Contestant], states: States) -> tuple[ThreadTime, ...]:
    """Time psdmc's batch functions on one and two threads, which share the inputs and have own outputs."""
    return tuple(
        ThreadTime(c.function, c.layout, threads, _ns_per_state(c, states, threads))
        for c in contestants
        if c.layout != "state" and c.rival == "psdmc factored" and c.function in SCALED
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


# Compared before anything is timed


CHECKED = 1024
"""States compared; enough to meet every term of a robot's dynamics."""

CHECKED_REALS = 1 << 24
"""Outputs compared, 128 MiB of them: a humanoid's regressor in standard parameters has 12,000 a state."""

FEWEST = 64
"""States compared of the largest of robots."""

SOLVED = 1e-7
STRICT = 1e-10
"""Largest error of an output relative to its largest value, if the function divides by the mass matrix, and otherwise."""

ROUNDINGS = 100
"""Rounding errors that the mass matrix's condition number may amplify, where that is more than `SOLVED`."""

SMALL = 1e-3
"""Outputs that stay below this share of the largest one are compared on its scale: they may be zero."""


def checked_states(outputs: int) -> int:
    """Return how many states of a function with this number of output values are compared. The number is a power of
    two, so that the states fill whole batches."""
    return min(CHECKED, 1 << int(np.log2(max(FEWEST, CHECKED_REALS // outputs))))


def disagreement(runner: Runner, states: States) -> float:
    """Return the largest error of a library's results for one function. The error of each output array is divided by
    the largest value of this array."""
    expected = states.expected(runner.contestant.function)
    found = runner.outputs()
    if runner.contestant.convention == "MuJoCo":
        found = states.from_mujoco(found)
    weights = runner.contestant.weights
    if weights is not None:
        found = found.reshape(states.count, -1, len(weights)) @ weights
        return relative_error(found, expected)
    ends = np.cumsum(output_sizes(runner.contestant.function, states.sizes))[:-1]
    blocks = zip(np.split(found, ends, axis=1), np.split(expected, ends, axis=1), strict=True)
    return max(relative_error(*block) for block in blocks)


def relative_error(found: Array, expected: Array) -> float:
    """Return the largest relative error: infinite for NaN, absolute if all expected values are zero."""
    largest = np.max(np.abs(expected), axis=0)
    error = np.abs(found - expected) / np.maximum(largest, SMALL * np.max(largest) or 1.0)
    return float(np.max(error)) if np.isfinite(error).all() else float("inf")


def tolerance(function: str, states: States) -> float:
    """Return the largest relative error with which the outputs of a function still count as equal to the expected ones.
    If the function divides by the mass matrix, the error grows with the condition number of that matrix."""
    if RECIPES[function].needs is not Needs.POSITIVE_MASS:
        return STRICT
    return max(SOLVED, ROUNDINGS * float(np.finfo(np.float64).eps) * states.condition)
