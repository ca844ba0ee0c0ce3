"""Groups of four outputs: when they are complete, and what the C text does with them."""

from __future__ import annotations

import pytest

from psdmc.backends.c.body import make_body
from psdmc.backends.c.lines import StoreGroups
from psdmc.program.program import Slot
from psdmc.program.text import parse


def _completed(size: int, order: list[int]) -> list[tuple[int, list[int]]]:
    """(output that became known, groups that it completed)."""
    groups = StoreGroups({"Y": size})
    steps = [(index, [slot.index for slot in groups.completed_by(Slot("Y", index))]) for index in order]
    return [step for step in steps if step[1]]


def test_a_group_is_complete_with_the_last_of_its_four() -> None:
    assert _completed(8, [0, 1, 2, 3, 4, 5, 6, 7]) == [(3, [0]), (7, [4])]
    assert _completed(8, [7, 0, 6, 1, 5, 2, 4, 3]) == [(4, [4]), (3, [0])]


def test_the_last_group_overlaps_where_four_does_not_divide_the_size() -> None:
    assert _completed(6, [0, 1, 2, 3, 4, 5]) == [(3, [0]), (5, [2])]
    assert _completed(6, [0, 1, 4, 5, 2, 3]) == [(3, [0, 2])]


@pytest.mark.parametrize("size", range(4, 14))
def test_every_output_is_in_a_group_and_no_group_reaches_beyond(size: int) -> None:
    starts = [start for _, found in _completed(size, list(range(size))) for start in found]
    assert sorted({start + k for start in starts for k in range(4)}) == list(range(size))


def test_outputs_of_other_vectors_complete_nothing() -> None:
    assert StoreGroups({}).completed_by(Slot("Y", 0)) == []


def test_a_group_is_stored_where_its_last_member_is_known_zeros_included() -> None:
    program = parse("""
        q = load q[0]
        a = load qd[0]
        x = mul q a
        y = mul q q
        z = add x y
        out Y[0] = x
        out Y[3] = y
        out Y[4] = z
    """)
    sizes = {"Y": 5}

    body = make_body(program, ("q", "qd"), sizes, "", stores_early=True, in_groups=tuple(sizes))

    assert [line.line for line in body.sections[-1].steps] == [
        "const V t2 = q_0 * qd_0",
        "STORE(Y, 0, t2)",
        "const V t3 = q_0 * q_0",
        "STORE(Y, 3, t3)",
        "const V t4 = t2 + t3",
        "STORE(Y, 4, t4)",
        "STORE(Y, 1, SPLAT(0.0))",
        "STORE(Y, 2, SPLAT(0.0))",
        "STORE_GROUP(Y, 0, t2, SPLAT(0.0), SPLAT(0.0), t3)",
        "STORE_GROUP(Y, 1, SPLAT(0.0), SPLAT(0.0), t3, t4)",
    ]
