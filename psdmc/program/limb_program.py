"""A function for one state, in which equal limbs (such as legs) run in the SIMD lanes of a vector.

The core is everything that is not in a limb. The operations of equal limbs are written once, as PROGRAMs (lists of
scalar operations) of one limb. They read the limb's inputs and constants, and values of the core, which are equal for
all limbs. The core reads sums over the limbs. Stages follow one another; each is computed by the core or by one group
of limbs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from weakref import proxy

from psdmc.program.interpret import Value, replayed
from psdmc.program.lanes import Lanes
from psdmc.program.products import ThinProducts
from psdmc.program.program import Op, Program, Slot
from psdmc.program.trace import Constant, Symbol, Tracer, arguments_of, constants_of, group_name

Spread = tuple[Slot, tuple[Slot, ...]]
"""A slot of a limb, and the function's own slots that it stands for, limb by limb."""

CORE = "core"
"""Vector of what the core computes and other stages read."""

THE_CORE = -1
"""In the place of a group's number, for what is the same for all limbs."""


@dataclass(frozen=True, slots=True)
class LimbGroup:
    """A group of limbs with equal structure, such as the legs of a quadruped.

    number     number of the group, which is in the names of its vectors
    count      number of limbs
    inputs     input entries of one limb, each with the function's input entries that belong to it, limb by limb
    constants  for each constant of one limb, `count` numbers, limb by limb
    outputs    output entries of one limb, each with the function's output entries that belong to it, limb by limb. An
               output entry of one limb may occur several times
    """

    number: int
    count: int
    inputs: tuple[Spread, ...]
    constants: tuple[tuple[float, ...], ...]
    outputs: tuple[Spread, ...]

    @property
    def name(self) -> str:
        """Return the first part of the names of the group's vectors. It contains the number of the group."""
        return group_name(self.number)

    @property
    def constant(self) -> str:
        """Vector of constants."""
        return constants_of(self.number)

    @property
    def partial(self) -> str:
        """Return the name of the vector of values that are summed over the limbs."""
        return f"{self.name}_partial"

    @property
    def sum(self) -> str:
        """Vector of the sums."""
        return f"{self.name}_sum"

    @property
    def kept(self) -> str:
        """Return the name of the vector in which the group keeps values for its later stages."""
        return f"{self.name}_kept"

    @property
    def output(self) -> str:
        """Vector of what it puts out."""
        return f"{self.name}_output"

    def input_of(self, vector: str) -> str:
        """Return the name of the vector with a limb's entries of the function's input `vector`."""
        return f"{self.name}_{vector}"


@dataclass(frozen=True, slots=True)
class Stage:
    """A part of a function with limbs: a PROGRAM (list of operations), and the number of the group whose limbs compute
    it. None: the core, everything outside limbs, computes it."""

    group: int | None
    program: Program


@dataclass(frozen=True, slots=True)
class LimbProgram:
    """A function as stages, in their order. A group of equal limbs, or the core outside the limbs, computes each stage.

    least     the smallest number of lanes with which this is cheaper than the function's straight-line code
    products  matrix products after the stages
    checked   True: if a pivot is not positive, only the elimination limb by limb is impossible. The C function then
              computes the state with its straight-line code
    """

    groups: tuple[LimbGroup, ...]
    stages: tuple[Stage, ...]
    least: int = 2
    products: tuple[ThinProducts, ...] = ()
    checked: bool = False


def unpacked(limbs: LimbProgram) -> Program:
    """Return the function without lanes, as one PROGRAM (list of operations) with the inputs and outputs of the
    function. The operations of each limb are written out."""
    tracer = Tracer()
    core: dict[Slot, Value] = {}
    own: dict[tuple[int, int], dict[Slot, Value]] = {
        (group.number, limb): _given(group, limb, tracer)
        for group in limbs.groups
        for limb in range(group.count)
    }
    outputs: list[tuple[Slot, Value]] = []
    by_number = {group.number: group for group in limbs.groups}
    for stage in limbs.stages:
        if stage.group is None:
            stored = _stored(stage.program, tracer, core)
            outputs += [(slot, value) for slot, value in stored.items() if slot.vector != CORE]
            core |= stored
            continue
        group = by_number[stage.group]
        found = []
        for limb in range(group.count):
            values = own[group.number, limb]
            values |= _stored(stage.program, tracer, core | values)
            found.append(values)
        core |= _sums(group, stage.program, found)
        outputs += _spread(group, stage.program, found)
    known = dict(outputs)
    whole = {slot: value for each in limbs.products for slot, value in each.multiplied(known)}
    internal = {vector for each in limbs.products for vector in each.sizes}
    kept = [each for each in outputs if each[0] not in whole and each[0].vector not in internal]
    return tracer.finish([*kept, *whole.items()])


def _given(group: LimbGroup, limb: int, tracer: Tracer) -> dict[Slot, Value]:
    values: dict[Slot, Value] = {slot: tracer.symbol(own[limb]) for slot, own in group.inputs}
    return values | {Slot(group.constant, k): row[limb] for k, row in enumerate(group.constants)}


def _stored(program: Program, tracer: Tracer, given: Mapping[Slot, Value]) -> dict[Slot, Value]:
    slots = (slot for slot, _ in program.outputs)
    return dict(zip(slots, replayed(program, tracer, given), strict=True))


def _sums(group: LimbGroup, program: Program, found: list[dict[Slot, Value]]) -> Iterator[tuple[Slot, Value]]:
    for slot, _ in program.outputs:
        if slot.vector == group.partial:
            total: Value = 0.0
            for values in found:
                total = total + values[slot]
            yield Slot(group.sum, slot.index), total


def _spread(
    group: LimbGroup, program: Program, found: list[dict[Slot, Value]]
) -> Iterator[tuple[Slot, Value]]:
    stored = {slot for slot, _ in program.outputs}
    for slot, own in group.outputs:
        if slot in stored:
            for limb, target in enumerate(own):
                yield target, found[limb][slot]


# Sums over limbs in a trace


class LimbSums:
    """The sums over limbs in one trace (recorded operations), which contains one limb of each group. A sum is recorded as
    an input of the trace, as `staged` needs it. Creating the object registers it with the trace's tracer.

    partials  for each group, index of a value in the trace -> number of the sum over the limbs
    summed    index of a sum in the trace -> index of the value that is summed
    """

    def __init__(self, tracer: Tracer, counts: Sequence[int]) -> None:
        # The tracer owns its sums. A cycle would keep each trace until Python looks for cycles.
        self.tracer: Tracer = proxy(tracer)
        self.counts = counts
        self.partials: list[dict[int, int]] = [{} for _ in counts]
        self.summed: dict[int, int] = {}
        self._names = [LimbGroup(number, count, (), (), ()).sum for number, count in enumerate(counts)]
        self._owners = {constants_of(number): number for number in range(len(counts))}
        self._groups: list[int] = []
        tracer.limb_sums = self

    def add_input(self, vector: str, group: int) -> None:
        """Declare that the entries of an input vector of the trace differ between the limbs of a group."""
        self._owners[vector] = group

    def group_of(self, index: int) -> int:
        """Return the number of the group between whose limbs a value differs. Return THE_CORE if the value is equal for all
        limbs.

        index  index of the value in the trace (recorded operations)
        """
        groups, steps = self._groups, self.tracer.steps
        for k in range(len(groups), index + 1):
            op, a, b = steps[k]
            if b is not None:
                groups.append(max(groups[a], groups[b]))
            elif op is Op.LOAD:
                groups.append(self._owners.get(a.vector, THE_CORE))
            else:
                groups.append(max((groups[each] for each in arguments_of(steps[k])), default=THE_CORE))
        return groups[index]

    def total(self, group: int, value: Symbol | Constant) -> Symbol | Constant:
        """Return the sum of a value over the limbs of a group. The given scalar has one value per limb."""
        if isinstance(value, Lanes):
            return math.fsum(value.values)
        if not isinstance(value, Symbol) or self.group_of(value.index) != group:
            return value * self.counts[group]
        numbers = self.partials[group]
        number = numbers.setdefault(value.index, len(numbers))
        found = self.tracer.symbol(Slot(self._names[group], number))
        self.summed[found.index] = value.index
        return -found if value.negative else found

    def stand_ins(self, vector: str, values: Sequence[Symbol | Constant]) -> list[Symbol]:
        """Return new inputs of the trace (recorded operations) that take the place of the given values. A new input
        differs between limbs if the value does."""
        return [self._stand_in(vector, k, value) for k, value in enumerate(values)]

    def _stand_in(self, vector: str, number: int, value: Symbol | Constant) -> Symbol:
        group = self.group_of(value.index) if isinstance(value, Symbol) else THE_CORE
        if group != THE_CORE:
            vector = f"{group_name(group)}_{vector}"
            self.add_input(vector, group)
        return self.tracer.symbol(Slot(vector, number))
