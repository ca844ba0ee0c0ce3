"""Stores of what limbs put out: done in their order, each output gets its own lane's real, zero, or what the core stored."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from limbed import EIGHT_LIMBS, SHAPES, forced, shape

from psdmc.backends.c.limb_rows import Gathered, Packed, Rows, Stored, stores
from psdmc.functions import RECIPES
from psdmc.program.limb_program import LimbGroup, LimbProgram, Stage
from psdmc.program.program import Slot
from psdmc.program.signature import Sizes
from psdmc.program.text import parse

OUT = "out"


def group(number: int, limbs: int, places: list[list[int]]) -> LimbGroup:
    """A group that puts out one slot for each list of indices, limb by limb."""
    outputs = tuple(
        (Slot(f"limbs{number}_output", k), tuple(Slot(OUT, index) for index in own))
        for k, own in enumerate(places)
    )
    return LimbGroup(number, limbs, (), (), outputs)


def program(groups: list[LimbGroup], core: list[int]) -> LimbProgram:
    lines = ["x = load q[0]", *(f"out {OUT}[{index}] = x" for index in core)]
    return LimbProgram(tuple(groups), (Stage(None, parse("\n".join(lines))),))


def assert_right(limbs: LimbProgram, sizes: dict[str, int]) -> list[Stored]:
    """Runs the stores on outputs that the core has stored into, and that hold anything else elsewhere."""
    done = list(stores(limbs, sizes))
    core = {slot for stage in limbs.stages for slot, _ in stage.program.outputs}
    wanted: dict[Slot, object] = {
        Slot(vector, k): "core" if Slot(vector, k) in core else None
        for vector, size in sizes.items()
        for k in range(size)
    }
    for each in limbs.groups:
        wanted |= {to: (each.number, slot, limb) for slot, own in each.outputs for limb, to in enumerate(own)}
    found: dict[Slot, object] = {slot: "core" if slot in core else "garbage" for slot in wanted}
    for store in done:
        for index, lane in store.written:
            assert 0 <= index < sizes[store.vector], store
            found[Slot(store.vector, index)] = lane
    assert found == wanted
    return done


def test_neighbours_of_each_limb_are_rows_zeros_behind_them() -> None:
    """Two limbs: a block of two by two each on the diagonal of a matrix, and the core's entry at its end."""
    limbs = program([group(0, 2, [[0, 12], [1, 13], [5, 17], [6, 18]])], core=[24])

    done = assert_right(limbs, {OUT: 25})
    rows = done[-2:]

    assert [(store.at, store.widths) for store in rows if isinstance(store, Rows)] == [
        ((0, 12), (4, 4)),
        ((5, 17), (4, 4)),
    ]
    assert done[:-2] == [Gathered(OUT, first, (None,) * 4) for first in (4, 9, 16, 20)]


def test_a_row_is_not_wider_than_what_the_core_stored_or_the_output_allow() -> None:
    limbs = program([group(0, 2, [[0, 7], [1, 8], [2, 9]])], core=[3])

    (rows,) = [store for store in assert_right(limbs, {OUT: 10}) if isinstance(store, Rows)]

    assert rows.widths == (3, 3)


def test_limbs_side_by_side_are_woven() -> None:
    limbs = program([group(0, 4, [[6, 9, 12, 15], [7, 10, 13, 16], [8, 11, 14, 17]])], core=list(range(6)))

    (packed,) = assert_right(limbs, {OUT: 18})

    assert isinstance(packed, Packed)
    assert list(packed.fours) == [6, 10, 14]


def test_five_neighbours_take_two_rows_each_and_the_second_limb_is_not_overwritten() -> None:
    """The fifth is followed by the next limb's first, which a row of four, done earlier, has stored."""
    limbs = program([group(0, 2, [[k, 5 + k] for k in range(5)])], core=[])

    assert_right(limbs, {OUT: 10})


@settings(max_examples=300, deadline=None)
@given(data=some.data())
def test_any_places(data: some.DataObject) -> None:
    size = data.draw(some.integers(1, 70))
    free = set(range(size))
    groups = []
    for number in range(data.draw(some.integers(1, 2))):
        limbs = data.draw(some.integers(2, 8))
        places: list[list[int]] = []
        for _ in range(data.draw(some.integers(1, 5))):
            first, stride = data.draw(some.integers(0, size)), data.draw(some.integers(1, 12))
            for k in range(data.draw(some.integers(1, 6))):
                own = [first + k + limb * stride for limb in range(limbs)]
                if set(own) <= free:
                    free -= set(own)
                    places.append(own)
        if places:
            groups.append(group(number, limbs, places))
    core = [index for index in sorted(free) if data.draw(some.booleans())]

    assert_right(program(groups, core), {OUT: size})


@pytest.mark.parametrize("function", ["inverse_dynamics", "mass_matrix"])
@pytest.mark.parametrize("name", [*SHAPES, *EIGHT_LIMBS])
def test_robots(name: str, function: str) -> None:
    model, limbs = shape(name)[1], forced(name, function).limbs
    assert limbs is not None
    sizes = Sizes.of(model.mechanism, model.l)

    assert_right(limbs, RECIPES[function].signature.sizes(sizes))


def test_a_mass_matrix_of_four_legs_gathers_no_lane() -> None:
    limbs = forced("four legs of a floating body", "mass_matrix").limbs
    assert limbs is not None

    done = list(stores(limbs, {"M": 18 * 18}))

    assert not [store for store in done if isinstance(store, Gathered) and any(store.lanes)]
    assert len([store for store in done if isinstance(store, Gathered)]) < 324 / 8
