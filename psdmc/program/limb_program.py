"""A function for one state, in which equal limbs (such as legs) run in the SIMD lanes of a vector.

The core is everything that is not in a limb. The operations of equal limbs are written once, as PROGRAMs (lists of
scalar operations) of one limb. They read the limb's inputs and constants, and values of the core, which are equal for
all limbs. The core reads sums over the limbs. Stages follow one another; each is computed by the core or by one group
of limbs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from psdmc.program.program import Program, Slot
from psdmc.program.replay import Value, replayed
from psdmc.program.thin_products import ThinProducts
from psdmc.program.trace import Tracer, constants_of, group_name

Spread = tuple[Slot, tuple[Slot, ...]]
"""A slot of a limb, and the function's own slots that it stands for, limb by limb."""

CORE = "core"
"""Vector of what the core computes and other stages read."""


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

    def with_least(self, least: int) -> LimbProgram:
        return replace(self, least=least)


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
