"""The C statements that store the outputs of limbs, such as the legs of a quadruped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from psdmc.backends.c.limb_rows import Lane, Packed, Rows, Stored, stores
from psdmc.program.limb_program import LimbProgram

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
    return StoreView(tuple(vectors), rows.group.count, tuple(_row_stores(rows)))


def _row_stores(rows: Rows) -> Iterator[str]:
    for limb, (first, width) in enumerate(zip(rows.at, rows.widths, strict=True)):
        yield f"{STORES[width]}({rows.vector} + {first}, row[{limb}])"
