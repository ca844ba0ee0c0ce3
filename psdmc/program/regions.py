"""A function as a list of regions. A region is straight-line code (without loops), a loop over slices of arrays, or a
call of another function.

Regions serve functions that multiply matrices or call another function several times. The length of straight-line code
for them grows with the square or the cube of the number of joints. Regions stay short. `run` executes them on numbers,
or on symbols that record straight-line code.

Regions read and write arrays of numbers by name: the function's inputs and outputs, and internal arrays. An entry must
be written before it is read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from psdmc.errors import InternalError
from psdmc.program.interpret import evaluated
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Program, Slot
from psdmc.program.trace import Symbol, Tracer

Scalar = Any
"""A number, an array of states, or a symbol."""


@dataclass(frozen=True, slots=True)
class Straight:
    """Code without loops: a PROGRAM (list of operations to generate) that reads and writes arrays of the function. It
    reads all entries before it writes one."""

    program: Program


@dataclass(frozen=True, slots=True)
class Slice:
    """A part of an array on which a loop works. In each iteration, the part starts `stride` entries later.

    name    name of the slice in the loop's code
    array   name of the array outside the loop
    first   index of the slice's start in the first iteration
    stride  number of entries by which the start moves per iteration
    """

    name: str
    array: str
    first: int = 0
    stride: int = 1


@dataclass(frozen=True, slots=True)
class For:
    """A loop: regions repeated a fixed number of times, with the loop's slices and all outer arrays."""

    count: int
    slices: tuple[Slice, ...]
    regions: tuple[Region, ...]


@dataclass(frozen=True, slots=True)
class Call:
    """A call of another generated function. If the calling function takes base parameters (theta_b), they are passed
    on.

    given   for each input of the called function, the array that is passed and the first entry passed
    found   for each output of the called function, the array that receives it and the first entry written
    pivots  number of pivots (divisors of a matrix factorisation) in the called function; if one is not positive, the
            calling function fails, too
    again   whether the pivots are the first ones of the calling function, which an earlier call has computed, too
    """

    function: str
    given: tuple[tuple[str, int], ...]
    found: tuple[tuple[str, int], ...]
    pivots: int = 0
    again: bool = False


Region = Straight | For | Call


@dataclass(frozen=True, slots=True)
class Regions:
    """The body of a generated function as loops, calls and straight-line code.

    arrays     the function's internal arrays: name -> length. An array with the name PIVOTS (signature.py) holds numbers
               that must be positive at the end
    constants  arrays of fixed numbers: name -> numbers
    """

    arrays: Mapping[str, int]
    regions: tuple[Region, ...]
    constants: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


def drop_unread(body: Regions) -> Regions:
    """Return the function body without stores into internal arrays that are never read. Slices and arrays that are then
    unused are left out, too.

    Keeps: outputs, bit for bit.
    """
    while True:
        kept = _touched(body.regions, _read_by, {}) | _called(body.regions)
        dead = frozenset(body.arrays) - kept
        regions = _without(body.regions, dead)
        if regions == body.regions:
            break
        body = replace(body, regions=regions)
    arrays = {name: size for name, size in body.arrays.items() if name in kept}
    return replace(body, arrays=arrays)


Touch = Callable[[Straight | Call], list[str]]
"""Names the arrays and slices that a region reads, or writes."""


def _touched(regions: Sequence[Region], touch: Touch, roots: Mapping[str, str]) -> set[str]:
    """Return the arrays that regions read, or write; `roots` are those that slices are parts of."""
    found: set[str] = set()
    for region in regions:
        if isinstance(region, For):
            inner = {each.name: roots.get(each.array, each.array) for each in region.slices}
            found |= _touched(region.regions, touch, {**roots, **inner})
        else:
            found.update(roots.get(name, name) for name in touch(region))
    return found


def _read_by(region: Straight | Call) -> list[str]:
    if isinstance(region, Straight):
        return [slot.vector for slot in region.program.inputs()]
    return [name for name, _ in region.given]


def _written_by(region: Straight | Call) -> list[str]:
    if isinstance(region, Straight):
        return [slot.vector for slot, _ in region.program.outputs]
    return [name for name, _ in region.found]


def read_late(body: Regions, inputs: Sequence[str], outputs: Sequence[str], theta: str) -> tuple[str, ...]:
    """Return the inputs that the function body reads after it has written an output. If the caller's arrays overlap, these
    inputs must be copied first.

    theta  name of the base parameters, which calls read; empty if they are no input
    """
    written, late = False, set[str]()
    for region in body.regions:
        read, found = (_touched((region,), touch, {}) for touch in (_read_by, _written_by))
        is_loop = isinstance(region, For)
        if written or (is_loop and found.intersection(outputs)):
            late |= read | ({theta} if _called((region,)) else set())
        written = written or bool(found.intersection(outputs))
    return tuple(name for name in inputs if name in late)


def _called(regions: Sequence[Region]) -> set[str]:
    """Arrays that calls write."""
    found: set[str] = set()
    for region in regions:
        if isinstance(region, For):
            found |= _called(region.regions)
        elif isinstance(region, Call):
            found |= {name for name, _ in region.found}
    return found


def _without(regions: Sequence[Region], dead: frozenset[str]) -> tuple[Region, ...]:
    """The regions that store nothing into dead arrays; those that have nothing left to do are gone."""
    found: list[Region] = []
    for region in regions:
        if isinstance(region, Straight):
            outputs = tuple(each for each in region.program.outputs if each[0].vector not in dead)
            if len(outputs) < len(region.program.outputs):
                region = Straight(drop_unused(Program(region.program.body, outputs)))
            if outputs:
                found.append(region)
        elif isinstance(region, For):
            inner = _without(
                region.regions, dead | {each.name for each in region.slices if each.array in dead}
            )
            used = _named(inner)
            slices = tuple(each for each in region.slices if each.name in used)
            if inner:
                found.append(For(region.count, slices, inner))
        else:
            found.append(region)
    return tuple(found)


def _named(regions: Sequence[Region]) -> set[str]:
    """Arrays and slices that regions name."""
    found: set[str] = set()
    for region in regions:
        if isinstance(region, For):
            found |= _named(region.regions) | {each.array for each in region.slices}
        else:
            found.update((*_read_by(region), *_written_by(region)))
    return found


@dataclass(frozen=True, slots=True)
class Column:
    """Values to store in an array, each `stride` entries after the one before. The stride is 1 for a vector. For a
    column of a matrix, it is the number of columns."""

    values: Sequence[Scalar]
    stride: int = 1
    first: int = 0


def straight(record: Callable[[Reader], Mapping[str, Column]]) -> Straight:
    """Return straight-line code that stores, array by array, the values that the function `record` computes. `record`
    gets a Reader, by which it reads entries of arrays."""
    tracer = Tracer()
    outputs = [
        (Slot(name, column.first + k * column.stride), value)
        for name, column in record(Reader(tracer)).items()
        for k, value in enumerate(column.values)
    ]
    return Straight(tracer.finish(outputs))


@dataclass(frozen=True, slots=True)
class Reader:
    """Reads entries of arrays as symbols."""

    tracer: Tracer

    def __call__(self, name: str, count: int, stride: int = 1, first: int = 0) -> list[Symbol]:
        return [self.tracer.symbol(Slot(name, first + k * stride)) for k in range(count)]


Caller = Callable[[str, list[list[Scalar]]], tuple[list[list[Scalar]], list[Scalar]]]
"""Of a function's name and its inputs: its outputs, and what must be positive."""


def run(
    body: Regions, inputs: Mapping[str, Sequence[Scalar]], outputs: Mapping[str, int], call: Caller
) -> tuple[dict[str, list[Scalar]], list[Scalar]]:
    """Execute a function body. Return its outputs, and the pivots (divisors of matrix factorisations) that must be
    positive, in order of computation. `outputs` gives the length of each output.

    Raises InternalError if an entry is read before it is written.
    """
    arrays: dict[str, list[Scalar]] = {name: list(values) for name, values in inputs.items()}
    arrays |= {name: list(values) for name, values in body.constants.items()}
    arrays |= {name: [None] * size for name, size in (*body.arrays.items(), *outputs.items())}
    places = {name: _Place(values, 0) for name, values in arrays.items()}
    pivots: list[Scalar] = []
    _run(body.regions, places, call, pivots)
    return {name: arrays[name] for name in outputs}, pivots


@dataclass(frozen=True, slots=True)
class _Place:
    """An array from one of its entries on."""

    values: list[Scalar]
    first: int

    def moved(self, entries: int) -> _Place:
        return _Place(self.values, self.first + entries)


def _run(
    regions: Sequence[Region], places: MutableMapping[str, _Place], call: Caller, pivots: list[Scalar]
) -> None:
    for region in regions:
        if isinstance(region, Straight):
            _run_straight(region.program, places)
        elif isinstance(region, For):
            for number in range(region.count):
                slices = {
                    each.name: places[each.array].moved(each.first + number * each.stride)
                    for each in region.slices
                }
                _run(region.regions, {**places, **slices}, call, pivots)
        else:
            _run_call(region, places, call, pivots)


def _run_straight(program: Program, places: Mapping[str, _Place]) -> None:
    def load(slot: Slot) -> Scalar:
        place = places[slot.vector]
        value = place.values[place.first + slot.index]
        if value is None:
            raise InternalError(f"{slot} is read before it is written")
        return value

    for slot, value in evaluated(program, load):
        place = places[slot.vector]
        place.values[place.first + slot.index] = value


def _run_call(call: Call, places: Mapping[str, _Place], caller: Caller, pivots: list[Scalar]) -> None:
    given = [places[name].values[places[name].first + first :] for name, first in call.given]
    found, own = caller(call.function, given)
    for (name, first), values in zip(call.found, found, strict=True):
        start = places[name].first + first
        places[name].values[start : start + len(values)] = values
    pivots += [] if call.again else own
