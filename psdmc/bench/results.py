"""What a benchmark run found, as plain values: JSON out, report and gate in."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from psdmc.bench.contestant import Unavailable
from psdmc.bench.machine import Machine
from psdmc.bench.measure import Times
from psdmc.bench.threads import ThreadTime

SCHEMA = 1


@dataclass(frozen=True, slots=True)
class Measurement:
    """One contestant on one robot.

    layout        'state', 'rows' or 'lanes'
    error         largest error of its outputs, relative to each output's largest value
    operations    (mul, add), None where unknown
    instructions  per state, as callgrind counts them on x86-64-v3; None where not counted
    """

    rival: str
    variant: str
    function: str
    layout: str
    error: float
    times: Times
    operations: tuple[int, int] | None = None
    instructions: float | None = None

    @property
    def ns(self) -> float:
        return self.times.throughput.median

    @property
    def label(self) -> str:
        return f"{self.rival} {self.variant}".strip()


@dataclass(frozen=True, slots=True)
class CaseResult:
    """One robot; `rounds` trials each, `idle` where the machine was so throughout."""

    name: str
    note: str
    n: int
    p: int | None
    l: int
    derive_seconds: float | None
    derive_bytes: int | None
    measurements: tuple[Measurement, ...]
    unavailable: tuple[Unavailable, ...]
    wrong: tuple[Unavailable, ...]
    rounds: int
    idle: bool
    threads: tuple[ThreadTime, ...] = ()

    def of(self, function: str, layout: str = "state") -> Iterator[Measurement]:
        """Measurements of one function, in the contestants' order."""
        return (m for m in self.measurements if m.function == function and m.layout == layout)

    def best(self, rival: str, function: str, layout: str = "state") -> Measurement | None:
        """A rival's better way of computing a function."""
        own = [m for m in self.of(function, layout) if m.rival == rival]
        return min(own, key=lambda m: m.ns) if own else None

    def ratio(
        self, function: str, layout: str = "state", *, over: str, rival: str = "psdmc factored"
    ) -> float | None:
        """How many times faster `rival` is than `over`'s better way for one state a call."""
        ours, theirs = self.best(rival, function, layout), self.best(over, function)
        return theirs.ns / ours.ns if ours and theirs else None


@dataclass(frozen=True, slots=True)
class BenchResult:
    """A whole run."""

    machine: Machine
    versions: dict[str, str]
    seed: int
    states: int
    cases: tuple[CaseResult, ...]
    scaling: tuple[CaseResult, ...] = ()

    @property
    def wrong(self) -> tuple[str, ...]:
        """Contestants that gave wrong results and were therefore not timed."""
        return tuple(f"{case.name}: {w.rival}: {w.reason}" for case in self.cases for w in case.wrong)

    def to_json(self) -> str:
        return json.dumps({"schema": SCHEMA, **asdict(self)}, indent=1)
