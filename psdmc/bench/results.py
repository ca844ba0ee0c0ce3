"""Results of a benchmark run as plain values, which are saved as JSON, shown in the report, and compared with the
baseline."""

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
    """The result of one compared function for one robot.

    layout        how states are passed: 'state' (one per call), 'rows' (one after the other) or 'lanes' (blocks of
                  states)
    error         largest error of the outputs, divided by the largest value of each output array
    operations    (multiplications, additions), None if unknown
    instructions  number per state, as callgrind counts them on x86-64-v3; None if not counted
    code_bytes    size of the machine code for one state; None if the library does not report it
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
    """The results for one robot, from `rounds` timed rounds over all functions. `idle` states whether no other program
    ran during these rounds."""

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
        """Return the measurements of one function in one memory layout of states, in the order of the libraries."""
        return (m for m in self.measurements if m.function == function and m.layout == layout)

    def best(self, rival: str, function: str, layout: str = "state") -> Measurement | None:
        """Return the measurement of a library's fastest algorithm for a function, None if there is none."""
        own = [m for m in self.of(function, layout) if m.rival == rival]
        return min(own, key=lambda m: m.ns) if own else None

    def ratio(
        self, function: str, layout: str = "state", *, over: str, rival: str = "psdmc factored"
    ) -> float | None:
        """Return how many times faster the library `rival` is than the fastest algorithm of the library `over` for one
        state per call. Return None if one of them was not measured.

        layout  memory layout of the states of `rival`
        """
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
        """Texts on the libraries' functions that gave wrong results and were therefore not timed."""
        return tuple(f"{case.name}: {w.rival}: {w.reason}" for case in self.cases for w in case.wrong)

    def to_json(self) -> str:
        return json.dumps({"schema": SCHEMA, **asdict(self)}, indent=1)

    @staticmethod
    def from_json(text: str) -> BenchResult:
        """Return the benchmark run from the text of to_json. Raise InputError if the text is something else."""
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
    """Return a value of the type `kind` from parsed JSON: dataclasses from objects, tuples from arrays."""
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
