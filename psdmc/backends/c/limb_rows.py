"""Decides how the outputs of limbs (such as legs) are stored: several neighbouring outputs of one limb as one vector.

While code computes, one vector holds the same output of all limbs, one limb per lane. In memory, several outputs may be
neighbours for every limb, as in the rows of a mass matrix. Four such vectors are then transposed in registers, and four
neighbouring numbers of each limb are stored at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count, groupby, takewhile

from psdmc.program.limb_program import LimbGroup, LimbProgram, Spread
from psdmc.program.program import Slot

FOUR = 4
"""Neighbours that are stored at once."""

Lane = tuple[int, Slot, int]
"""A real that a limb puts out: its group's number, the group's slot, and which limb."""


@dataclass(frozen=True, slots=True)
class Rows:
    """Up to four neighbouring outputs of every limb of a group (such as four legs). The vectors of the group, one limb
    per lane, are transposed before the outputs are stored.

    vector  name of the function's output
    group   the limbs
    slots   for each neighbour, the entry of the group's vectors that is stored; None: zero
    at      for each limb, the index of its first neighbour in the function's output
    widths  for each limb, how many numbers are stored
    """

    vector: str
    group: LimbGroup
    slots: tuple[Slot | None, ...]
    at: tuple[int, ...]
    widths: tuple[int, ...]

    @property
    def written(self) -> Iterator[tuple[int, Lane | None]]:
        """Yield each stored entry with the lane that holds it, in the order of memory."""
        for limb, (first, width) in enumerate(zip(self.at, self.widths, strict=True)):
            for k in range(width):
                slot = self.slots[k]
                yield first + k, None if slot is None else (self.group.number, slot, limb)


@dataclass(frozen=True, slots=True)
class Packed:
    """Two or three neighbouring outputs of every limb of a group (such as four legs). In memory, the limbs follow one
    another without gaps, so their vectors are interleaved when they are stored.

    slots  entries of the group's vectors, in the order of memory
    first  index of the first output in the function's output vector
    """

    vector: str
    group: LimbGroup
    slots: tuple[Slot, ...]
    first: int

    @property
    def fours(self) -> range:
        """Where each four of them begins."""
        return range(self.first, self.first + len(self.slots) * self.group.count, FOUR)

    @property
    def written(self) -> Iterator[tuple[int, Lane | None]]:
        """Yield each stored entry with the lane that holds it, in the order of memory."""
        lanes = [(self.group.number, slot, limb) for limb in range(self.group.count) for slot in self.slots]
        yield from enumerate(lanes, self.first)


@dataclass(frozen=True, slots=True)
class Gathered:
    """One output, or four neighbouring ones, from any lanes (limbs) of any vectors. None in `lanes` is zero."""

    vector: str
    first: int
    lanes: tuple[Lane | None, ...]

    @property
    def written(self) -> Iterator[tuple[int, Lane | None]]:
        """Yield each stored entry with the lane that holds it, in the order of memory."""
        yield from enumerate(self.lanes, self.first)


Stored = Rows | Packed | Gathered


def stores(limbs: LimbProgram, sizes: Mapping[str, int]) -> Iterator[Stored]:
    """Yield the stores of all outputs of limbs, and of zeros, in the order in which the stores must be executed.
    `sizes` are the lengths of the output vectors.

    A store may overwrite a neighbouring entry only if a later store writes the right value there. Outputs that the core
    (code outside limbs) has stored are kept. Outputs that matrix products store are left out.
    """
    own = {slot for stage in limbs.stages for slot, _ in stage.program.outputs}
    own |= {slot for each in limbs.products for slot in each.written}
    for vector, size in sizes.items():
        cores = {slot.index for slot in own if slot.vector == vector}
        yield from _Vector(vector, size, cores, limbs.groups).stores()


@dataclass(frozen=True, slots=True)
class _Run:
    """Outputs of a group that are each other's neighbours for every limb: their slots, and limb by limb where they begin."""

    group: LimbGroup
    slots: tuple[Slot, ...]
    at: tuple[int, ...]

    @property
    def is_packed(self) -> bool:
        """Return whether full vectors of four outputs can be stored by interleaving two or three vectors."""
        count, wide = len(self.at), len(self.slots)
        side_by_side = tuple(range(self.at[0], self.at[0] + wide * count, wide))
        return wide < FOUR and count % FOUR == 0 and self.at == side_by_side

    def rows(self, vector: str, before: int) -> Iterator[Rows]:
        """Yield the outputs of each limb in rows of four neighbours. The first row begins `before` entries earlier, and
        these entries are None (zero)."""
        padded = (*(None,) * before, *self.slots, *(None,) * (-(before + len(self.slots)) % FOUR))
        for k in range(0, len(padded), FOUR):
            first = tuple(index - before + k for index in self.at)
            yield Rows(vector, self.group, padded[k : k + FOUR], first, (FOUR,) * len(first))


class _Vector:
    """One output of the function."""

    def __init__(self, vector: str, size: int, cores: set[int], groups: Sequence[LimbGroup]) -> None:
        self.vector = vector
        self.lanes: dict[int, Lane] = {}
        runs: list[_Run] = []
        for group in groups:
            spreads = [spread for spread in group.outputs if spread[1][0].vector == vector]
            for slot, own in spreads:
                self.lanes |= {to.index: (group.number, slot, limb) for limb, to in enumerate(own)}
            runs += _runs(group, spreads)
        self.runs = sorted((run for run in runs if len(run.slots) > 1), key=lambda run: run.at)
        self.place = {
            first + k: (number, limb, k)
            for number, run in enumerate(self.runs)
            for limb, first in enumerate(run.at)
            for k in range(len(run.slots))
        }
        self.zero = set(range(size)) - self.lanes.keys() - cores

    def stores(self) -> Iterator[Stored]:
        rows: list[Stored] = []
        done: set[int] = set()
        for number, run in enumerate(self.runs):
            if run.is_packed:
                rows.append(Packed(self.vector, run.group, run.slots, run.at[0]))
                continue
            spare = range(-len(run.slots) % FOUR + 1)
            ways = [way for before in spare if (way := self._rows(number, run, before)) is not None]
            best = max(ways, key=lambda way: len(self._zeros_of(way) - done))
            done |= self._zeros_of(best)
            rows += best
        yield from self._zeros(done)
        yield from self._gathered(sorted(self.lanes.keys() - self.place.keys()))
        yield from rows

    def _zeros_of(self, rows: Sequence[Rows]) -> set[int]:
        return {index for each in rows for index, _ in each.written} & self.zero

    def _rows(self, number: int, run: _Run, before: int) -> list[Rows] | None:
        """A run's stores, beginning that many places before it; None where something else lies there. As wide as what lies
        behind it allows: it is zero, or stored later."""
        *whole, last = run.rows(self.vector, before)
        used = before + len(run.slots) - FOUR * len(whole)

        def is_free(piece: int, limb: int, indices: range) -> bool:
            return all(i in self.zero or self._when(i, before) > (number, piece, limb) for i in indices)

        if not all(is_free(0, limb, range(at - before, at)) for limb, at in enumerate(run.at)):
            return None
        widths = tuple(
            FOUR if is_free(len(whole), limb, range(at + used, at + FOUR)) else used
            for limb, at in enumerate(last.at)
        )
        return [*whole, replace(last, widths=widths)]

    def _when(self, index: int, before: int) -> tuple[int, int, int]:
        """When an output is stored: number of its run, piece of a run that begins so many places before it, and limb."""
        number, limb, k = self.place.get(index, (-1, 0, 0))
        return number, (before + k) // FOUR, limb

    def _zeros(self, done: set[int]) -> Iterator[Gathered]:
        """Zeros that no row stores, before anything else: four at once may lie over what limbs put out later."""
        later = self.zero | self.lanes.keys()
        stored: set[int] = set()
        for index in sorted(self.zero - done):
            if index in stored:
                continue
            starts = (index - k for k in range(FOUR))
            four = next((s for s in starts if all(i in later for i in range(s, s + FOUR))), None)
            first, count = (index, 1) if four is None else (four, FOUR)
            stored |= set(range(first, first + count))
            yield Gathered(self.vector, first, (None,) * count)

    def _gathered(self, alone: Sequence[int]) -> Iterator[Gathered]:
        """Outputs without neighbours of their limb: four at once where they are each other's."""
        for _, run in groupby(enumerate(alone), key=lambda each: each[1] - each[0]):
            together = [index for _, index in run]
            whole = len(together) // FOUR * FOUR
            for k in range(0, whole, FOUR):
                four = tuple(self.lanes[index] for index in together[k : k + FOUR])
                yield Gathered(self.vector, together[k], four)
            for index in together[whole:]:
                yield Gathered(self.vector, index, (self.lanes[index],))


def _runs(group: LimbGroup, spreads: Sequence[Spread]) -> Iterator[_Run]:
    left = {tuple(to.index for to in own): slot for slot, own in spreads}
    for at in sorted(left):
        if _moved(at, -1) in left:
            continue
        slots = takewhile(lambda slot: slot is not None, (left.get(_moved(at, k)) for k in count()))
        yield _Run(group, tuple(filter(None, slots)), at)


def _moved(at: Sequence[int], by: int) -> tuple[int, ...]:
    return tuple(index + by for index in at)


NONE = "none"
"""Suffix of a group's vector of zeros."""

STORES = {1: "STORE_ONE", 2: "STORE_TWO", 3: "STORE_THREE", 4: "STORE_ROW"}
"""Macros that store as many of a row's four reals."""

MADE_BY = {2: "pairs", 3: "triples", 4: "rows"}
"""What C functions that make rows are called, by the number of vectors that they take."""


@dataclass(frozen=True, slots=True)
class StoreView:
    """The C statements of one store of limb outputs, or of one such store for each limb (such as a leg).

    vectors  vectors that are combined before the store: four are transposed, two or three are interleaved; empty: none
    count    number of limbs
    lines    C statements
    """

    vectors: tuple[str, ...]
    count: int
    lines: tuple[str, ...]

    @property
    def made_by(self) -> str:
        """C function that makes the rows."""
        return f"limbs{self.count}_{MADE_BY[len(self.vectors)]}"


def store_views(limbs: LimbProgram, sizes: Mapping[str, int]) -> tuple[StoreView, ...]:
    """Return the C statements that store the outputs of limbs (such as legs) in a kernel, the code of one function
    variant. `sizes` are the lengths of the output vectors."""
    names = {group.number: (group.count, group.output) for group in limbs.groups}

    def text(lane: Lane | None) -> str:
        if lane is None:
            return "0"
        number, slot, limb = lane
        return f"LIMBS{names[number][0]}_AT({slot}, {limb})"

    def view(each: Stored) -> StoreView:
        if isinstance(each, Packed):
            return _packed(each)
        if isinstance(each, Rows):
            return _rows(each)
        texts = [text(lane) for lane in each.lanes]
        if len(texts) == 1:
            return StoreView((), 0, (f"{each.vector}[{each.first}] = {texts[0]}",))
        return StoreView((), 0, (f"STORE_FOUR({each.vector} + {each.first}, {', '.join(texts)})",))

    return tuple(view(each) for each in stores(limbs, sizes))


def _packed(packed: Packed) -> StoreView:
    lines = (f"STORE_ROW({packed.vector} + {first}, row[{k}])" for k, first in enumerate(packed.fours))
    return StoreView(tuple(map(str, packed.slots)), packed.group.count, tuple(lines))


def _rows(rows: Rows) -> StoreView:
    none = f"limbs{rows.group.count}_{NONE}"
    vectors = (none if slot is None else str(slot) for slot in rows.slots)
    lines = (
        f"{STORES[width]}({rows.vector} + {first}, row[{limb}])"
        for limb, (first, width) in enumerate(zip(rows.at, rows.widths, strict=True))
    )
    return StoreView(tuple(vectors), rows.group.count, tuple(lines))
