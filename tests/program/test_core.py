"""Text, checker, interpreter and cost."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from psdmc.errors import InternalError
from psdmc.program.cost import cost
from psdmc.program.interpret import interpret
from psdmc.program.program import Instr, Op, Program, Slot, check
from psdmc.program.text import parse, show

SMALL = """
    a = load q[0]
    s = sin a
    c = cos a
    k = const 0.1
    x = mul k s
    y = sub x c
    z = div y k
    n = neg z
    out tau[1] = n
    out tau[0] = y
"""


def test_text_shows_one_instruction_a_line():
    assert show(parse(SMALL)).splitlines() == [
        "t0 = load q[0]",
        "t1 = sin t0",
        "t2 = cos t0",
        "t3 = const 0.1",
        "t4 = mul t3 t1",
        "t5 = sub t4 t2",
        "t6 = div t5 t3",
        "t7 = neg t6",
        "out tau[1] = t7",
        "out tau[0] = t5",
    ]


def test_text_reads_back_what_it_shows(some_program: Program):
    assert parse(show(some_program)) == some_program


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("a = frobnicate", "frobnicate"),
        ("a = load q", "no slot"),
        ("a = add b c", "'b'"),
        ("a = const", "line 1"),
        ("out tau[0] = a", "'a'"),
    ],
)
def test_text_that_cannot_be_read_names_its_line(line: str, complaint: str):
    with pytest.raises(ValueError, match="line 1") as caught:
        parse(line)
    assert complaint in str(caught.value)


def test_an_operation_with_too_few_arguments_cannot_be_read():
    with pytest.raises(ValueError, match="add takes 2 arguments"):
        parse("a = load q[0]\nb = add a")


LOAD = Instr(Op.LOAD, slot=Slot("q", 0))
OUT = (Slot("tau", 0), 0)


@pytest.mark.parametrize(
    ("program", "complaint"),
    [
        (Program((LOAD, Instr(Op.ADD, (0,))), (OUT,)), "t1 = add has 1 arguments"),
        (Program((Instr(Op.NEG, (0,)),), (OUT,)), "t0 uses a value that is not defined before it"),
        (Program((Instr(Op.LOAD),), (OUT,)), "slot"),
        (Program((LOAD, Instr(Op.NEG, (0,), value=1.0)), (OUT,)), "have a value"),
        (Program((Instr(Op.CONST, value=float("nan")),), (OUT,)), "constant nan"),
        (Program((LOAD,), (OUT, OUT)), "stored twice"),
        (Program((LOAD,), ((Slot("tau", 0), 1),)), "not defined"),
    ],
)
def test_the_checker_names_the_pass_and_the_instruction(program: Program, complaint: str):
    with pytest.raises(InternalError, match="after my_pass") as caught:
        check(program, after="my_pass")
    assert complaint in str(caught.value)


def test_the_checker_hands_a_sound_program_on(some_program: Program):
    assert check(some_program) is some_program


def test_the_interpreter_computes_what_the_text_says_and_broadcasts():
    q = np.linspace(-2.0, 2.0, 8).reshape(2, 4, 1)

    tau = interpret(parse(SMALL), {"q": q}, {"tau": 3})["tau"]

    y = 0.1 * np.sin(q[..., 0]) - np.cos(q[..., 0])
    assert tau.shape == (2, 4, 3)
    np.testing.assert_array_equal(tau[..., 0], y)
    np.testing.assert_array_equal(tau[..., 1], -(y / 0.1))
    np.testing.assert_array_equal(tau[..., 2], 0.0)


def test_cost_counts_operations_and_distinct_angles():
    counted = cost(parse(SMALL))

    assert (counted.mul, counted.add, counted.div, counted.neg, counted.sincos) == (1, 1, 1, 1, 1)
    assert counted.total == 2
    assert str(counted) == "1 mul + 1 add + 1 div + 1 sincos"


def test_cost_counts_products_that_an_addition_can_absorb():
    program = parse("""
        a = load q[0]
        b = load q[1]
        once = mul a b
        twice = mul a a
        x = add once twice
        y = sub x twice
        out tau[0] = y
    """)

    assert cost(program).fused == 1


def test_inputs_are_listed_once_in_order():
    program = parse("""
        b = load q[1]
        c = load q[1]
        a = load q[0]
        v = load a[3]
        out tau[0] = v
    """)

    assert [str(slot) for slot in program.inputs()] == ["a[3]", "q[0]", "q[1]"]


def test_uses_count_arguments_and_outputs(some_program: Program, outputs: Callable[[Program], np.ndarray]):
    arguments = [a for instr in some_program for a in instr.args]
    stored = [index for _, index in some_program.outputs]

    assert some_program.uses() == [(arguments + stored).count(i) for i in range(len(some_program))]
