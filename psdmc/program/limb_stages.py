"""Division of a PROGRAM (list of operations) with equal limbs into stages. Each stage is computed by one group of
limbs, or by the core (everything outside limbs).

First come the core's values that do not depend on limbs, then the values of the limbs, then the core's values that
depend on sums over limbs, and so on.
"""

from __future__ import annotations

from collections.abc import Sequence

from psdmc.errors import InternalError
from psdmc.program.check import check
from psdmc.program.limb_program import CORE, LimbGroup, Stage
from psdmc.program.program import Instr, Op, Program, Slot

Place = tuple[int, int]
"""Of a stage: how many sums lie before it, and the group that computes it; the core, which is first, is -1."""

THE_CORE = -1


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
