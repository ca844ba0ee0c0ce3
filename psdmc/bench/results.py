"""Results of a benchmark run as plain values, which are saved as JSON, shown in the report, and compared with the
baseline. A run is also printed as text."""

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
class ThreadTime:
    """The time of a batch function on several threads, ns per state, all threads together."""

    function: str
    layout: str
    threads: int
    ns: float


@dataclass(frozen=True, slots=True)
class CaseResult:
    """The results for one robot from `rounds` timed rounds, and whether no other program ran (`idle`)."""

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


# As text for a terminal


def as_text(result: BenchResult) -> str:
    """Return the results as text: operations, ns, quartiles, latency, error, and time over the fastest."""
    machine = result.machine
    head = [f"{machine.processor}, {machine.cores} cores, {machine.compiler}, {machine.flags}"]
    return "\n".join(head + [line for case in result.cases for line in _case_lines(case)])


def _case_lines(case: CaseResult) -> list[str]:
    idle = "machine idle" if case.idle else "MACHINE BUSY: times are not reliable"
    facts = [f"n {case.n}, p {case.p}, l {case.l}", case.note, f"{case.rounds} trials, {idle}"]
    lines = ["", f"{case.name}: {'; '.join(fact for fact in facts if fact)}"]
    for function in dict.fromkeys(m.function for m in case.measurements):
        lines.append(f"  {function}")
        same = [m for m in case.measurements if m.function == function]
        lines += [_line(m) for m in sorted(same, key=lambda m: m.ns)]
    return lines + _not_measured(case)


def _not_measured(case: CaseResult) -> list[str]:
    """A line for each reason, with all rivals that it holds for."""
    missing = (*case.unavailable, *case.wrong)
    rivals = {u.reason: [other.rival for other in missing if other.reason == u.reason] for u in missing}
    return [
        f"  not measured: {', '.join(dict.fromkeys(names))}: {reason}" for reason, names in rivals.items()
    ]


def _line(m: Measurement) -> str:
    operations = f"{m.operations[0]} + {m.operations[1]}" if m.operations else ""
    spread = m.times.throughput
    text = f"    {m.label:<32} {m.layout:<6} {operations:>14} {m.ns:10.1f} ns  [{spread.low:.1f}, {spread.high:.1f}]"
    if m.times.latency:
        text += f"  latency {m.times.latency.median:.1f}"
    if m.times.cold:
        text += f"  cold {m.times.cold.median:.0f}"
    if m.code_bytes is not None:
        text += f"  code {m.code_bytes / 1e3:.1f} KB"
    return f"{text}  error {m.error:.0e}"
