"""A PROGRAM in parts: one after the other they store what the whole does, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from random_programs import SEEDS, outputs_of, random_program

from psdmc.program.interpret import interpret
from psdmc.program.parts import LEEWAY, Parts, in_parts
from psdmc.program.program import Op, Program, Slot
from psdmc.program.text import parse, show

LONGEST = 12


def cut(program: Program, groups: list[list[Slot]] | None = None, late: bool = False) -> Parts:
    return in_parts(program, ["kept"] * len(program), groups or [], late, LONGEST)


def run(parts: Parts) -> np.ndarray:
    """(50, 3) outputs: each part reads what those before it have kept; what is not yet kept is NaN."""
    q, qd = np.random.default_rng(7).uniform(-1, 1, (2, 50, 3))
    kept = np.full((50, parts.kept.get("kept", 0)), np.nan)
    found = np.full((50, 3), np.nan)
    for program in parts.programs:
        stored = interpret(program, {"q": q, "qd": qd, "kept": kept}, {"tau": 3, "kept": kept.shape[1]})
        for slot, _ in program.outputs:
            into = {"tau": found, "kept": kept}[slot.vector]
            into[:, slot.index] = stored[slot.vector][:, slot.index]
    return found


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_parts_compute_what_the_whole_does(seed: int, late: bool) -> None:
    program = random_program(seed, length=150)

    parts = cut(program, [[Slot("tau", 0), Slot("tau", 2)]], late)

    assert len(parts.programs) > 3
    assert np.array_equal(run(parts), outputs_of(program))


@pytest.mark.parametrize("seed", SEEDS)
def test_parts_are_about_as_long_as_asked_for(seed: int) -> None:
    program = random_program(seed, length=300)
    of_angles = 2 * sum(instr.op in (Op.SIN, Op.COS) for instr in program)  # these are not cut apart

    for part in cut(program).programs:
        assert sum(bool(instr.args) for instr in part) <= (1 + 2 * LEEWAY) * LONGEST + of_angles


@pytest.mark.parametrize("seed", SEEDS)
def test_no_input_is_read_behind_the_first_part_that_stores_an_output(seed: int) -> None:
    parts = cut(random_program(seed, length=150)).programs
    first = next(k for k, part in enumerate(parts) if any(slot.vector == "tau" for slot, _ in part.outputs))

    for part in parts[first + 1 :]:
        assert {slot.vector for slot in part.inputs()} <= {"kept"}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_group_is_stored_by_one_part_and_late_outputs_by_the_last(seed: int) -> None:
    program = random_program(seed, length=150)
    both = [Slot("tau", 0), Slot("tau", 2)]

    stored = [{slot for slot, _ in part.outputs} for part in cut(program, [both]).programs]
    assert all(slots.isdisjoint(both) or slots.issuperset(both) for slots in stored)

    *others, last = cut(program, late=True).programs
    assert {slot for slot, _ in last.outputs} >= {Slot("tau", k) for k in range(3)}
    assert all(slot.vector == "kept" for part in others for slot, _ in part.outputs)


def test_a_cut_lies_where_few_values_cross() -> None:
    program = parse("""
        a = load q[0]
        b = load q[1]
        s = add a b
        x = mul s s
        y = mul x a
        z = add x y
        u = add z z
        v = mul u u
        w = mul v u
        out tau[0] = w
    """)

    first, second = in_parts(program, ["kept"] * len(program), [], False, 4).programs

    assert show(first).splitlines()[-1] == "out kept[0] = t5"
    assert show(second).splitlines() == [
        "t0 = load kept[0]",
        "t1 = add t0 t0",
        "t2 = mul t1 t1",
        "t3 = mul t2 t1",
        "out tau[0] = t3",
    ]
