"""From values to C text: brackets, names and constants."""

from __future__ import annotations

import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from psdmc.backends.c.body import Body, make_body
from psdmc.backends.c.expressions import DEEPEST, literal
from psdmc.program.program import Instr, Op, Program, Slot
from psdmc.program.text import parse


def lines(text: str, outputs: int = 1, stores_early: bool = False) -> list[str]:
    body = make_body(parse(text), ("q", "qd"), {"tau": outputs}, "", stores_early)
    return [step.line for section in body.sections for step in section.steps]


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        (["x = add a b", "y = mul x c"], "(a + b) * c"),
        (["x = add a b", "y = mul c x"], "c * (a + b)"),
        (["x = mul a b", "y = add x c"], "a * b + c"),
        (["x = mul a b", "y = sub c x"], "c - a * b"),
        (["x = add a b", "y = sub c x"], "c - (a + b)"),
        (["x = sub a b", "y = sub x c"], "a - b - c"),
        (["x = mul a b", "y = mul c x"], "c * (a * b)"),
        (["x = div a b", "y = div c x"], "c / (a / b)"),
        (["x = neg a", "y = mul x b", "z = add y c"], "-a * b + c"),
        (["x = neg a", "y = sub b x", "z = add y c"], "b - (-a) + c"),
        (["x = add a b", "y = neg x", "z = mul y c"], "-(a + b) * c"),
        (["x = neg a", "y = neg x", "z = add y b", "w = add z c"], "-(-a) + b + c"),
        (["k = const -2.0", "x = add a k", "y = mul x b", "z = mul y c"], "(a + (-2.0)) * b * c"),
        (["k = const -2.0", "x = mul k a", "y = mul x b", "z = mul y c"], "-2.0 * a * b * c"),
    ],
)
def test_brackets_stand_only_where_c_needs_them(steps: list[str], expected: str) -> None:
    last = steps[-1].split()[0]
    text = "\n".join(["a = load q[0]", "b = load q[1]", "c = load q[2]", *steps, f"out tau[0] = {last}"])
    for name, load in zip("abc", ("q_0", "q_1", "q_2"), strict=True):
        expected = expected.replace(name, load)
    used, stored = lines(text)
    assert used.split(" = ")[1] == expected
    assert stored == f"STORE(tau, 0, {used.split()[2]})"


def test_values_used_twice_get_a_name_and_others_do_not() -> None:
    assert lines("""
        a = load q[0]
        b = load qd[0]
        x = mul a b
        y = add x a
        z = mul y y
        out tau[0] = z
    """) == ["const V t3 = q_0 * qd_0 + q_0", "const V t4 = t3 * t3", "STORE(tau, 0, t4)"]


def test_what_parameters_alone_give_is_a_plain_real() -> None:
    assert lines("""
        a = load q[0]
        p = load theta_b[0]
        r = load theta_b[1]
        x = mul p r
        y = mul x a
        z = add y x
        out tau[0] = z
        out tau[1] = x
    """, 2) == [
        "const real t3 = theta_b_0 * theta_b_1",
        "const V t5 = t3 * q_0 + t3",
        "STORE(tau, 0, t5)",
        "STORE(tau, 1, SPLAT(t3))",
    ]  # fmt: skip


def test_outputs_that_are_not_stored_become_zero() -> None:
    assert lines("a = load q[0]\nout tau[1] = a", 3) == [
        "STORE(tau, 1, q_0)",
        "STORE(tau, 0, SPLAT(0.0))",
        "STORE(tau, 2, SPLAT(0.0))",
    ]


def test_large_outputs_are_stored_as_they_are_found() -> None:
    text = "a = load q[0]\nx = add a a\nout tau[0] = x\ny = mul x x\nout tau[1] = y"
    assert lines(text, 2, stores_early=True) == [
        "const V t1 = q_0 + q_0",
        "STORE(tau, 0, t1)",
        "const V t2 = t1 * t1",
        "STORE(tau, 1, t2)",
    ]


def test_angles_are_gathered_before_anything_else_and_by_what_they_need() -> None:
    program = parse("""
        a = load q[0]
        b = load q[1]
        u = mul a a
        s = sin a
        w = mul u s
        t = add a b
        c = cos t
        d = sin s
        x = mul w c
        y = add x d
        out tau[0] = y
    """)
    first, second, last = make_body(program, ("q", "qd"), {"tau": 1}, "", False).sections
    assert [(angle.text, angle.sine, angle.cosine) for angle in first.angles] == [
        ("q_0", "sin_0", None),
        ("q_0 + q_1", None, "cos_5"),
    ]
    assert [(angle.text, angle.sine) for angle in second.angles] == [("sin_0", "sin_3")]
    assert [step.line for step in last.steps][-1] == "STORE(tau, 0, t9)"
    assert make_body(program, ("q", "qd"), {"tau": 1}, "", False).unused == ("qd",)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_constants_read_back_bit_for_bit(value: float) -> None:
    assert struct.pack("d", float(literal(value, "").text)) == struct.pack("d", value)


def _nesting(text: str) -> int:
    deepest = depth = 0
    for letter in text:
        depth += {"(": 1, ")": -1}.get(letter, 0)
        deepest = max(deepest, depth)
    return deepest


def _chain(seed: int, length: int = 200) -> Program:
    choose = random.Random(seed)
    body = [Instr(Op.LOAD, slot=Slot("q", i)) for i in range(3)]
    for _ in range(length):
        op = choose.choice([Op.ADD, Op.SUB, Op.MUL])
        other = choose.randrange(3)
        args = (len(body) - 1, other) if choose.random() < 0.5 else (other, len(body) - 1)
        body.append(Instr(op, args))
    return Program(tuple(body), ((Slot("tau", 0), len(body) - 1),))


@pytest.mark.parametrize("seed", range(5))
def test_no_expression_nests_deeper_than_the_limit(seed: int) -> None:
    body: Body = make_body(_chain(seed), ("q",), {"tau": 1}, "", False)
    texts = [step.line for section in body.sections for step in section.steps]
    assert max(_nesting(text) for text in texts) <= DEEPEST
    assert max(sum(text.count(f" {sign} ") for sign in "+-*") for text in texts) <= 2**DEEPEST
    assert len(texts) < 150
