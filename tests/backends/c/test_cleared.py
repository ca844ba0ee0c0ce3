"""Which outputs are cleared as runs of zeros."""

from __future__ import annotations

import pytest

from psdmc.backends.c.body import LEAST, cleared, make_body, without_zeros
from psdmc.backends.c.lines import Cleared
from psdmc.program.program import Instr, Op, Program, Slot

SIZE = 2 * LEAST


def storing(*indices: int) -> Program:
    """x stored in these entries, and zero in the one behind the last of them."""
    body = (Instr(Op.LOAD, slot=Slot("x", 0)), Instr(Op.CONST, value=0.0))
    outputs = [(Slot("y", index), 0) for index in indices]
    return Program(body, (*outputs, (Slot("y", indices[-1] + 1), 1)))


def test_runs_lie_between_what_is_stored() -> None:
    program = storing(0, 5, 8)
    runs = cleared(program, {"y": SIZE})
    assert runs == (Cleared("y", 1, 4), Cleared("y", 9, SIZE - 9))  # of 6 and 7 each is stored
    assert [slot.index for slot, _ in without_zeros(program, runs).outputs] == [0, 5, 8]


def test_runs_end_with_a_vector() -> None:
    assert cleared(storing(0), {"x": LEAST // 2, "y": LEAST}) == (
        Cleared("x", 0, LEAST // 2),
        Cleared("y", 1, LEAST - 1),
    )


@pytest.mark.parametrize(("size", "count"), [(LEAST, 0), (LEAST + 1, 1)])
def test_few_zeros_are_stored_one_by_one(size: int, count: int) -> None:
    assert len(cleared(storing(0), {"y": size})) == count


def test_outputs_that_rows_take_from_a_block_are_stored_there() -> None:
    """Beside a matrix in groups, STORE_BLOCK stores a vector's entries in every form; STORE_ZERO would not in rows."""
    body = make_body(storing(0), (), {"M": LEAST, "y": SIZE}, "", stores_early=True, in_groups=("M",))
    lines = [line.line for section in body.sections for line in section.steps]
    assert [line for line in lines if line.startswith("CLEAR")] == [f"CLEAR(M, 0, {LEAST})"]
    assert sum(line.startswith("STORE_BLOCK(y, ") for line in lines) == SIZE
