"""Division of a long PROGRAM (list of operations) into parts that are compiled one by one. Compile time grows faster
than the length of straight-line code.

Each part is a PROGRAM. Values that later parts need are stored in vectors, which these parts read. The order of values
puts the angles (arguments of sines and cosines) first, in groups that can be computed together.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import ceil

from psdmc.program.program import Instr, Op, Program, Slot, check

TRIGONOMETRIC = frozenset((Op.SIN, Op.COS))


def angle_groups(program: Program) -> list[list[int]]:
    """Return the angles (arguments of sines and cosines) in groups. The angles of a group can be computed together,
    because they depend on sines and cosines of earlier groups only."""
    first = next((i for i, (op, _, _, _) in enumerate(program.body) if op in TRIGONOMETRIC), None)
    if first is None:  # as in most parts of a long PROGRAM
        return []
    level = [0] * first
    groups: dict[int, dict[int, None]] = {}
    for op, args, _, _ in program.body[first:]:
        below = max([level[a] for a in args]) if args else 0
        is_trig = op in TRIGONOMETRIC
        if is_trig:
            groups.setdefault(below, {})[args[0]] = None
        level.append(below + 1 if is_trig else below)
    return [list(groups[key]) for key in sorted(groups)]


def cone(program: Program, roots: list[int]) -> list[int]:
    """Return the given values `roots` and all values on which they depend, in the PROGRAM's order."""
    needed = [False] * len(program)
    for root in roots:
        needed[root] = True
    for i in reversed(range(max(roots) + 1)):
        if needed[i]:
            for a in program.body[i].args:
                needed[a] = True
    return [i for i, wanted in enumerate(needed) if wanted]


def angles_first(program: Program) -> list[list[int]]:
    """Return all values of the PROGRAM once, each after its arguments. There is one list per group of angles (see
    `angle_groups`), and one for the rest.

    The list of a group contains the values from which the angles are computed, then the sines and cosines of the
    angles.
    """
    taken: dict[int, list[int]] = {}
    for i, (op, args, _, _) in enumerate(program.body):
        if op in TRIGONOMETRIC:
            taken.setdefault(args[0], []).append(i)
    done = [False] * len(program)
    found = []
    for group in angle_groups(program):
        wanted = [*cone(program, group), *(i for angle in group for i in taken[angle])]
        found.append([i for i in wanted if not done[i]])
        for i in wanted:
            done[i] = True
    return [*found, [i for i in range(len(program)) if not done[i]]]


CONSTANT = -1
"""Position and part of a constant, which each part has."""

LEEWAY = 0.25
"""Share of a part's length by which its end may move to where few values are read beyond it."""


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of a divided PROGRAM (list of operations) in their order, and the vectors that pass values from part to
    part.

    kept  length of each of these vectors, by name
    """

    programs: tuple[Program, ...]
    kept: Mapping[str, int]


def in_parts(
    program: Program, kept_in: Sequence[str], groups: Sequence[Collection[Slot]], late: bool, longest: int
) -> Parts:
    """Divide the PROGRAM into parts of about `longest` operations and stores each.

    kept_in  for each value, the name of the vector that takes it if a later part reads it
    groups   groups of output entries that one part must store together; every other entry is stored separately
    late     True: the last part stores all outputs; False: each part stores the outputs whose values it completes

    Keeps: output values, bit for bit. All inputs are read before the first output is stored, in an earlier part or in
    the part that stores it.
    """
    return _Cut(program, kept_in, groups, late, longest).parts()


class _Cut:
    def __init__(
        self,
        program: Program,
        kept_in: Sequence[str],
        groups: Sequence[Collection[Slot]],
        late: bool,
        longest: int,
    ) -> None:
        self.program, self.kept_in = program, kept_in
        sections = angles_first(program)
        self.order = [i for section in sections for i in section if program.body[i].op is not Op.CONST]
        self.position = [CONSTANT] * len(program)
        for k, i in enumerate(self.order):
            self.position[i] = k
        self.stored_at = self._stored_at(groups, late)
        self.ends = self._ends(longest)
        self.part = [self._part_at(k) if k != CONSTANT else CONSTANT for k in self.position]
        self.outputs = self._outputs()
        self.read_in = self._read_in()
        self.first_store = min((p for p, outputs in enumerate(self.outputs) if outputs), default=0)
        self.leaving, self.computed = self._leaving(), self._computed()

    def _stored_at(self, groups: Sequence[Collection[Slot]], late: bool) -> dict[Slot, int]:
        """Return for each output the position in the order behind which it is stored."""
        last = len(self.order) - 1
        if late:
            return {slot: last for slot, _ in self.program.outputs}
        known = {slot: self.position[i] for slot, i in self.program.outputs}
        for group in groups:
            together = [slot for slot in group if slot in known]
            known |= dict.fromkeys(together, max((known[slot] for slot in together), default=CONSTANT))
        return {slot: last if at == CONSTANT else at for slot, at in known.items()}

    def _ends(self, longest: int) -> list[int]:
        """Positions before which a part ends, but for the last one."""
        weight = self._weights()
        total = sum(weight)
        count = max(1, ceil(total / longest))
        reach = LEEWAY * total / count
        crossing = self._crossing_at()
        sums = [0.0]
        for each in weight:
            sums.append(sums[-1] + each)
        ends: list[int] = []
        for k in range(1, count):
            middle = k * total / count
            first = max(1, *(end + 1 for end in ends[-1:]), bisect_left(sums, middle - reach - 1.0))
            behind = min(len(self.order), bisect_right(sums, middle + reach + 1.0))
            near = [
                b
                for b in range(first, behind)
                if abs(sums[b] - middle) <= reach and not self._is_within_angles(b)
            ]
            if near:
                ends.append(min(near, key=lambda b: (crossing[b], b)))
        return ends

    def _weights(self) -> list[int]:
        weight = [0 if self.program.body[i].op is Op.LOAD else 1 for i in self.order]
        for position in self.stored_at.values():
            weight[position] += 1
        return weight

    def _is_within_angles(self, boundary: int) -> bool:
        """Whether the sines of one group of angles lie on both sides."""
        before, behind = (self.program.body[self.order[b]].op for b in (boundary - 1, boundary))
        return {before, behind} <= {Op.SIN, Op.COS}

    def _crossing_at(self) -> list[int]:
        """Return for each position how many values from before it are read from it on."""
        last = list(self.position)
        for position, i in enumerate(self.order):  # ascending: the last one stays
            for a in self.program.body[i].args:
                last[a] = position
        for slot, i in self.program.outputs:
            last[i] = max(last[i], self.stored_at[slot])
        change = [0] * (len(self.order) + 2)
        for i in self.order:
            change[self.position[i] + 1] += 1
            change[last[i] + 1] -= 1
        crossing, now = [], 0
        for each in change:
            now += each
            crossing.append(now)
        return crossing

    def _part_at(self, position: int) -> int:
        return bisect_right(self.ends, position)

    def _outputs(self) -> list[list[tuple[Slot, int]]]:
        outputs: list[list[tuple[Slot, int]]] = [[] for _ in range(len(self.ends) + 1)]
        for slot, i in self.program.outputs:
            outputs[self._part_at(self.stored_at[slot])].append((slot, i))
        return outputs

    def _read_in(self) -> dict[int, set[int]]:
        """The parts that read a value which is not a constant, except that which computes it."""
        read: dict[int, set[int]] = {}
        body, part = self.program.body, self.part
        computed = [CONSTANT if instr.op is Op.LOAD else part[i] for i, instr in enumerate(body)]
        for i in self.order:
            for a in body[i].args:
                if computed[a] != part[i] and part[a] != CONSTANT:
                    read.setdefault(a, set()).add(part[i])
        for p, outputs in enumerate(self.outputs):
            for _, i in outputs:
                if computed[i] != p and part[i] != CONSTANT:
                    read.setdefault(i, set()).add(p)
        return read

    def _is_free(self, value: int, part: int) -> bool:
        """Whether a part makes this value itself, though others do: constants, and inputs before anything is stored."""
        op = self.program.body[value].op
        return op is Op.CONST or (op is Op.LOAD and part <= self.first_store)

    def _home(self, value: int) -> int:
        """The part that stores a value for later ones."""
        is_load = self.program.body[value].op is Op.LOAD
        return self.first_store if is_load else self.part[value]

    def parts(self) -> Parts:
        slots, lengths = self._slots()
        programs = tuple(self._program(p, slots) for p in range(len(self.outputs)))
        return Parts(programs, lengths)

    def _slots(self) -> tuple[dict[int, Slot], dict[str, int]]:
        """Where values lie that later parts read; a place is free again behind the last part that reads it."""
        slots: dict[int, Slot] = {}
        lengths: dict[str, int] = {}
        free: dict[str, list[int]] = {}
        until: dict[int, list[Slot]] = {}
        for p in range(len(self.outputs)):
            for slot in until.pop(p - 1, []):
                free.setdefault(slot.vector, []).append(slot.index)
            for i in self.leaving[p]:
                vector = self.kept_in[i]
                places = free.get(vector, [])
                if not places:
                    places = [lengths.setdefault(vector, 0)]
                    lengths[vector] += 1
                slots[i] = Slot(vector, places.pop())
                until.setdefault(max(self.read_in[i]), []).append(slots[i])
        return slots, lengths

    def _leaving(self) -> list[list[int]]:
        """Return for each part the values that it stores for later ones."""
        leaving: list[list[int]] = [[] for _ in self.outputs]
        for i in filter(self.read_in.__contains__, self.order):
            home = self._home(i)
            if any(p > home and not self._is_free(i, p) for p in self.read_in[i]):
                leaving[home].append(i)
        return leaving

    def _computed(self) -> list[list[int]]:
        """Return for each part the values that it computes."""
        computed: list[list[int]] = [[] for _ in self.outputs]
        for i in self.order:
            if self.program.body[i].op is not Op.LOAD:
                computed[self.part[i]].append(i)
        return computed

    def _program(self, part: int, slots: Mapping[int, Slot]) -> Program:
        body: list[Instr] = []
        here: dict[int, int] = {}

        def local(i: int) -> int:
            if i not in here:
                here[i] = len(body)
                is_own = self._is_free(i, part)
                body.append(self.program.body[i] if is_own else Instr(Op.LOAD, slot=slots[i]))
            return here[i]

        for i in self.computed[part]:
            instr = self.program.body[i]
            for a in instr.args:
                if a not in here:
                    local(a)
            here[i] = len(body)
            body.append(instr.renumbered(here))
        outputs = [(slot, local(i)) for slot, i in self.outputs[part]]
        outputs += [(slots[i], local(i)) for i in self.leaving[part]]
        return check(Program(tuple(body), tuple(outputs)), after="cutting into parts")
