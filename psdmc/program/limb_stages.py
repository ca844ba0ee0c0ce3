"""Division of a PROGRAM (list of operations) with equal limbs into stages. Each stage is computed by one group of
limbs, or by the core (everything outside limbs).

First come the core's values that do not depend on limbs, then the values of the limbs, then the core's values that
depend on sums over limbs, and so on.

To find the cheapest code, psdmc compares hundreds of possible forms of the code. It counts the operations of most forms
on their traces (recorded operations), because to divide a trace into stages takes longer. The number of operations of a
trace equals that of the stages that `staged` would return.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields

from psdmc.errors import InternalError
from psdmc.program.cost import Cost, cost, counted
from psdmc.program.limb_program import CORE, THE_CORE, LimbGroup, LimbProgram, Stage
from psdmc.program.program import Instr, Op, Program, Slot, check
from psdmc.program.trace import Step, arguments_of

Place = tuple[int, int]
"""Of a stage: how many sums lie before it, and the group that computes it; the core, which is first, is -1."""


def staged(program: Program, groups: Sequence[LimbGroup]) -> tuple[Stage, ...]:
    """Return the stages of a PROGRAM (list of operations) with equal limbs. One group of limbs, or the core outside the
    limbs, computes each stage.

    In addition to the function's inputs, the PROGRAM reads inputs, constants and sums of the groups. In addition to the
    function's outputs, it stores outputs of the groups, and values that are to be summed.

    Keeps: output values, bit for bit; instructions, except that several stages may repeat constants and loads. Raises
    InternalError if an operation combines values of limbs of two groups, or if a limb's value is an output of the core.
    """
    return _Split(program, groups).stages()


class _Split:
    def __init__(self, program: Program, groups: Sequence[LimbGroup]) -> None:
        self.program = program
        self.owner: dict[str, int] = {}
        self.kept = {group.number: group.kept for group in groups} | {THE_CORE: CORE}
        self.partial_of = {group.sum: group.partial for group in groups}
        for group in groups:
            vectors = {group.constant, group.partial}
            vectors |= {slot.vector for slot, _ in (*group.inputs, *group.outputs)}
            self.owner |= dict.fromkeys(sorted(vectors), group.number)
        self.group = self._groups()
        self.level = self._levels()
        self.place = [(level, group) for level, group in zip(self.level, self.group, strict=True)]
        self.is_free = [self._may_be_repeated(instr) for instr in program.body]
        self.stored = self._stored()
        self.crossing = self._crossing()

    def _groups(self) -> list[int]:
        groups: list[int] = []
        for instr in self.program.body:
            if instr.slot is not None:
                groups.append(self.owner.get(instr.slot.vector, THE_CORE))
                continue
            found = {groups[a] for a in instr.args} - {THE_CORE}
            if len(found) > 1:
                raise InternalError("limbs of two groups meet in one value")
            groups.append(found.pop() if found else THE_CORE)
        return groups

    def _levels(self) -> list[int]:
        """Return how many sums each value depends on, one behind the other."""
        stored = dict(self.program.outputs)
        levels = [0] * len(self.program)
        for _ in range(len(self.program) + 1):
            before = list(levels)
            for i, instr in enumerate(self.program.body):
                if instr.slot is not None and instr.slot.vector in self.partial_of:
                    partial = Slot(self.partial_of[instr.slot.vector], instr.slot.index)
                    levels[i] = 1 + levels[stored[partial]]
                elif instr.args:
                    levels[i] = max(levels[a] for a in instr.args)
            if levels == before:
                return levels
        raise InternalError("a sum over limbs depends on itself")

    def _may_be_repeated(self, instr: Instr) -> bool:
        """Constants, and loads that every stage may make: all but those of the function's own inputs, which the first stage
        reads before anything is stored."""
        if instr.op is Op.CONST:
            return True
        vector = None if instr.slot is None else instr.slot.vector
        return vector in self.owner or vector in self.partial_of

    def _stored(self) -> dict[Place, list[tuple[Slot, int]]]:
        """Return the outputs of each stage, of those of the whole PROGRAM."""
        stored: dict[Place, list[tuple[Slot, int]]] = {}
        for slot, i in self.program.outputs:
            group = self.owner.get(slot.vector, THE_CORE)
            if group == THE_CORE and self.group[i] != THE_CORE:
                raise InternalError(f"{slot} is the core's, and differs from limb to limb")
            stored.setdefault((self.level[i], group), []).append((slot, i))
        return stored

    def _crossing(self) -> dict[int, Slot]:
        """Values that other stages read, and where they are kept."""
        read = {
            a
            for i, instr in enumerate(self.program.body)
            for a in instr.args
            if self._crosses(a, self.place[i])
        }
        read |= {i for place, outputs in self.stored.items() for _, i in outputs if self._crosses(i, place)}
        slots: dict[int, Slot] = {}
        used: dict[int, int] = {}
        for i in sorted(read):
            group = self.group[i]
            slots[i] = Slot(self.kept[group], used.setdefault(group, 0))
            used[group] += 1
        return slots

    def _crosses(self, value: int, place: Place) -> bool:
        return not self.is_free[value] and self.place[value] != place

    def stages(self) -> tuple[Stage, ...]:
        busy = {
            p for p, instr, free in zip(self.place, self.program.body, self.is_free, strict=True) if not free
        }
        places = sorted(busy | self.stored.keys())
        return tuple(
            Stage(None if group == THE_CORE else group, self._stage((level, group)))
            for level, group in places
        )

    def _stage(self, place: Place) -> Program:
        body: list[Instr] = []
        here: dict[int, int] = {}

        def local(i: int) -> int:
            if i not in here:
                instr = self.program.body[i]
                here[i] = len(body)
                body.append(instr if self.is_free[i] else Instr(Op.LOAD, slot=self.crossing[i]))
            return here[i]

        for i, instr in enumerate(self.program.body):
            if self.place[i] == place and not self.is_free[i]:
                moved = {a: local(a) for a in instr.args}
                here[i] = len(body)
                body.append(instr.renumbered(moved))
        outputs = [(slot, local(i)) for slot, i in self.stored.get(place, [])]
        outputs += [(slot, here[i]) for i, slot in self.crossing.items() if self.place[i] == place]
        return check(Program(tuple(body), tuple(outputs)), after="cutting into stages")


# Costs of stages


_LOAD, _CONST, _MUL = Op.LOAD, Op.CONST, Op.MUL
_ADD, _SUB, _SIN, _COS = Op.ADD, Op.SUB, Op.SIN, Op.COS


@dataclass(frozen=True, slots=True)
class StageCost:
    """The cost of one stage of a function with limbs. A stage is a part that one group of equal limbs, or the core
    (everything outside limbs), computes.

    group   number of the group whose limbs compute the stage; None: the core
    cost    operations, those of a limb counted once
    shared  number of values of the core that limbs read
    sums    number of sums over the limbs
    """

    group: int | None
    cost: Cost
    shared: int
    sums: int


def whole_cost(limbs: LimbProgram) -> Cost:
    """Return the cost of all stages of a function with limbs, and of the matrix products after them. Operations of
    equal limbs are counted once."""
    costs = [cost(stage.program) for stage in limbs.stages]
    costs += [each.cost for each in limbs.products]
    return Cost(*(sum(getattr(each, part.name) for each in costs) for part in fields(Cost)))


def stage_costs(limbs: LimbProgram) -> Iterator[StageCost]:
    """Return the cost of each stage of a function with limbs, in their order. A stage is a part that one group of
    limbs, or the core, computes."""
    groups = {group.number: group for group in limbs.groups}
    for stage in limbs.stages:
        own_cost = cost(stage.program)
        if stage.group is None:
            yield StageCost(None, own_cost, 0, 0)
            continue
        group = groups[stage.group]
        own = {group.constant, group.kept} | {slot.vector for slot, _ in group.inputs}
        shared = sum(slot.vector not in own for slot in stage.program.inputs())
        sums = sum(slot.vector == group.partial for slot, _ in stage.program.outputs)
        yield StageCost(stage.group, own_cost, shared, sums)


def traced_stage_costs(
    steps: Sequence[Step],
    stored: Sequence[tuple[Slot, int]],
    partial_of: Mapping[int, int],
    groups: Sequence[LimbGroup],
) -> list[StageCost]:
    """Return the cost of each stage of a recorded function with limbs, in their order. Only operations that the outputs
    need are counted.

    stored      output slots of the core and of limbs, with the index of the value; without sums over limbs
    partial_of  index of the input that is a sum over limbs -> index of the value that is summed

    Raises InternalError if an operation combines values of limbs of two groups, or if a limb's value is an output of
    the core.
    """
    needed, partials = _needed(steps, stored, partial_of)
    return _Count(steps, partial_of, groups).of(needed, stored, partials)


def _needed(
    steps: Sequence[Step], stored: Sequence[tuple[Slot, int]], partial_of: Mapping[int, int]
) -> tuple[bytearray, list[int]]:
    """Return which steps some output needs, through sums, too, and the values that are summed. A value precedes its sum."""
    needed, partials = bytearray(len(steps)), []
    for _, index in stored:
        needed[index] = 1
    for i in range(len(steps) - 1, -1, -1):
        if not needed[i]:
            continue
        op, a, b = steps[i]
        if b is not None:
            needed[a] = needed[b] = 1
        elif op is _LOAD:
            if i in partial_of:
                partials.append(partial_of[i])
                needed[partial_of[i]] = 1
        else:
            for argument in arguments_of(steps[i]):
                needed[argument] = 1
    return needed, partials


@dataclass(slots=True)
class _Stage:
    """Counts of a stage.

    others  its operations but products, sums and sines
    added   arguments of its sums and differences
    angles  whose sine or cosine is taken
    shared  core's values that it reads
    """

    mul: int = 0
    others: list[Op] = field(default_factory=list)
    sums: int = 0
    added: list[tuple[int, int]] = field(default_factory=list)
    angles: set[int] = field(default_factory=set)
    shared: set[int] = field(default_factory=set)


class _Count:
    """A stage is a number: sums that lie before it, times groups and core, plus its group; the core is the first."""

    def __init__(
        self, steps: Sequence[Step], partial_of: Mapping[int, int], groups: Sequence[LimbGroup]
    ) -> None:
        self.steps, self.partial_of, self.kinds = steps, partial_of, len(groups) + 1
        self.owner = {
            vector: group.number + 1
            for group in groups
            for vector in (group.constant, *(slot.vector for slot, _ in (*group.inputs, *group.outputs)))
        }
        self.place = [0] * len(steps)
        self.is_free = bytearray(len(steps))  # constants and loads that every stage may make
        self.uses = [0] * len(steps)  # within the value's own stage
        self.crossing: set[int] = set()
        self.stages: dict[int, _Stage] = {}

    def of(
        self, needed: bytearray, stored: Sequence[tuple[Slot, int]], partials: Sequence[int]
    ) -> list[StageCost]:
        for i, step in enumerate(self.steps):
            if needed[i]:
                self._count(i, step)
        for slot, index in stored:
            self._store(index, self.owner.get(slot.vector, 0))
        for index in partials:
            self._store(index, self.place[index] % self.kinds)
            self._stage(self.place[index]).sums += 1
        for index in self.crossing:
            self.uses[index] += 1
        return [self._cost(place) for place in sorted(self.stages)]

    def _count(self, i: int, step: Step) -> None:
        op, a, b = step
        if op is _CONST:
            self.is_free[i] = 1
        elif op is _LOAD:
            self._load(i, a)
        else:
            arguments = arguments_of(step)
            place = self.place[arguments[0]]
            for argument in arguments[1:]:
                place = self._meeting(place, self.place[argument])
            self.place[i] = place
            stage = self._stage(place)
            for argument in arguments:
                self._read(argument, place)
            if op is _MUL:
                stage.mul += 1
            elif op is _ADD or op is _SUB:
                stage.added.append((a, b))
            elif op is _SIN or op is _COS:
                stage.angles.add(a)
            else:
                stage.others.append(op)

    def _load(self, i: int, slot: Slot) -> None:
        summed = self.partial_of.get(i)
        if summed is not None:
            level = self.place[summed] // self.kinds
            self.place[i] = (level + 1) * self.kinds
        else:
            self.place[i] = self.owner.get(slot.vector, 0)
        self.is_free[i] = summed is not None or slot.vector in self.owner

    def _meeting(self, one: int, other: int) -> int:
        """The stage of a value that is computed from two stages' values."""
        if one == other:
            return one
        kinds = self.kinds
        group, second = one % kinds, other % kinds
        if group and second and group != second:
            raise InternalError("limbs of two groups meet in one value")
        return max(one // kinds, other // kinds) * kinds + max(group, second)

    def _stage(self, place: int) -> _Stage:
        found = self.stages.get(place)
        if found is None:
            found = self.stages[place] = _Stage()
        return found

    def _read(self, value: int, place: int) -> None:
        """A stage reads a value: its own, one that crosses, or one that is there for all."""
        own = self.place[value]
        if not self.is_free[value]:
            if own == place:
                self.uses[value] += 1
                return
            self.crossing.add(value)
        elif self.steps[value][0] is _CONST:
            return
        if place % self.kinds and not own % self.kinds:
            self.stages[place].shared.add(value)

    def _store(self, value: int, group: int) -> None:
        level, own = divmod(self.place[value], self.kinds)
        if own and not group:
            raise InternalError("a value that differs from limb to limb is stored as the core's")
        place = level * self.kinds + group
        self._stage(place)
        self._read(value, place)

    def _cost(self, place: int) -> StageCost:
        stage, group = self.stages[place], place % self.kinds
        fused = sum(self._absorbs(a, place) or self._absorbs(b, place) for a, b in stage.added)
        own = counted(stage.others, stage.mul, len(stage.added), len(stage.angles), fused)
        return StageCost(group - 1 if group else None, own, len(stage.shared), stage.sums)

    def _absorbs(self, value: int, place: int) -> bool:
        """Whether a value is a product that nothing else in its stage uses."""
        return self.steps[value][0] is _MUL and self.uses[value] == 1 and self.place[value] == place
