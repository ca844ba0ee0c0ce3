"""The results of a benchmark run as plain values, for JSON, report and gate."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, is_dataclass
from itertools import repeat
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from psdmc.bench.contestant import Unavailable
from psdmc.bench.machine import Machine
from psdmc.bench.measure import Times
from psdmc.bench.threads import ThreadTime
from psdmc.errors import InputError

SCHEMA = 1


@dataclass(frozen=True, slots=True)
class Measurement:
    """One contestant on one robot.

    layout        'state', 'rows' or 'lanes'
    error         largest error of its outputs, relative to each output's largest value
    operations    (mul, add), None where unknown
    instructions  per state, as callgrind counts them on x86-64-v3; None where not counted
    code_bytes    of machine code for one state; None where the library does not tell
    """

    rival: str
    variant: str
    function: str
    layout: str
    error: float
    times: Times
    operations: tuple[int, int] | None = None
    instructions: float | None = None
    code_bytes: int | None = None

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
        """How many times faster `rival` is than the better way of `over`, for one state a call."""
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

    @staticmethod
    def from_json(text: str) -> BenchResult:
        """The run in a text of to_json; InputError where the text is something else."""
        try:
            content = json.loads(text)
            if content.pop("schema") != SCHEMA:
                raise InputError(
                    "the benchmark's JSON is of another schema", "measure again: psdmc bench --json"
                )
            result: BenchResult = rebuilt(BenchResult, content)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(
                f"not a benchmark's JSON: {error}", "make it with: psdmc bench --json"
            ) from error
        return result


def rebuilt(kind: Any, value: Any) -> Any:
    """A value of a result's type from what JSON made of it: dataclasses from objects, tuples from arrays."""
    arguments = get_args(kind)
    if value is None or kind is Any:
        return value
    if get_origin(kind) in (UnionType, Union):
        return rebuilt(next(a for a in arguments if a is not type(None)), value)
    if get_origin(kind) is tuple:
        inner = repeat(arguments[0]) if arguments[-1] is Ellipsis else arguments
        return tuple(rebuilt(k, v) for k, v in zip(inner, value, strict=False))
    if is_dataclass(kind):
        make: Any = kind
        kinds = get_type_hints(kind)
        return make(**{name: rebuilt(kinds[name], item) for name, item in value.items()})
    return value
