"""A benchmark run from top to bottom: build the contestants, see that they are right, then time them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from psdmc.bench.agree import CHECKED, disagreement, tolerance
from psdmc.bench.case import Case
from psdmc.bench.contestant import Contestant, Runner, Unavailable
from psdmc.bench.machine import this_machine
from psdmc.bench.measure import measure
from psdmc.bench.results import BenchResult, CaseResult, Measurement
from psdmc.bench.rivals import EVERYONE, Entrant
from psdmc.bench.states import COUNT, States
from psdmc.bench.versions import versions

SEED = 20_260
ROUNDS = 12
"""Trials that count; with 1,024 blocks each the 99.99th percentile rests on more than 10,000 blocks."""

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Settings:
    """How to measure.

    rounds    trials of each contestant that count
    states    fresh random states per trial
    seed      of states
    rivals    names of EVERYONE to run; None: all
    """

    rounds: int = ROUNDS
    states: int = COUNT
    seed: int = SEED
    rivals: tuple[str, ...] | None = None

    def entrants(self) -> tuple[Entrant, ...]:
        return tuple(e for e in EVERYONE if self.rivals is None or e.name in self.rivals)


def _silent(message: str) -> None:
    del message


def run(cases: Sequence[Case], settings: Settings = Settings(), progress: Progress = _silent) -> BenchResult:
    """Measure every case; rivals that cannot be built are listed with the reason, wrong ones are not timed."""
    results = tuple(run_case(case, settings, progress) for case in cases)
    return BenchResult(this_machine(), versions(), settings.seed, settings.states, results)


def run_case(case: Case, settings: Settings = Settings(), progress: Progress = _silent) -> CaseResult:
    """Measure one robot."""
    contestants: list[Contestant] = []
    unavailable: list[Unavailable] = []
    for entrant in settings.entrants():
        progress(f"{case.name}: building {entrant.name}")
        for one in entrant.contestants(case):
            if isinstance(one, Contestant):
                contestants.append(one)
            else:
                unavailable.append(one)
    progress(f"{case.name}: checking")
    right, errors, wrong = checked(case, contestants, settings.seed + 1)
    states = States.random(case.chain, settings.states, settings.seed)
    runners = [Runner(contestant, states) for contestant in right]
    measured = measure(runners, settings.rounds, lambda message: progress(f"{case.name}: {message}"))
    measurements = tuple(
        Measurement(c.rival, c.variant, c.function, c.layout, error, times, c.operations)
        for c, error, times in zip(right, errors, measured.times, strict=True)
    )
    model = case.model
    return CaseResult(
        case.name, case.note, case.n, model.p, model.l, case.derive_seconds,
        measurements, tuple(unavailable), wrong, measured.rounds, measured.idle,
    )  # fmt: skip


def checked(
    case: Case, contestants: Sequence[Contestant], seed: int
) -> tuple[list[Contestant], list[float], tuple[Unavailable, ...]]:
    """Those whose outputs are right, their errors, and the others with what was wrong."""
    states = States.random(case.chain, CHECKED, seed)
    right: list[Contestant] = []
    errors: list[float] = []
    wrong: list[Unavailable] = []
    for contestant in contestants:
        error = disagreement(Runner(contestant, states), states)
        if error <= tolerance(contestant.function):
            right.append(contestant)
            errors.append(error)
        else:
            what = f"{contestant.label}, {contestant.function} ({contestant.layout})"
            wrong.append(Unavailable(what, f"wrong results: relative error {error:.1e}, so it was not timed"))
    return right, errors, tuple(wrong)
