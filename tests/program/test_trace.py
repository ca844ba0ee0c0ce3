"""What the tracer records, and what it leaves out."""

from __future__ import annotations

import random

import numpy as np
import pytest

from psdmc.program.cost import cost
from psdmc.program.interpret import interpret
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Program, Slot, check
from psdmc.program.text import show
from psdmc.program.trace import Symbol, Tracer


def traced(*expressions) -> Program:
    """Each expression is a function of q[0] and q[1]."""
    tracer = Tracer()
    q = tracer.symbols("q", 2)
    return tracer.finish([(Slot("tau", i), f(*q)) for i, f in enumerate(expressions)])


def test_mirrored_differences_and_products_are_recorded_once():
    program = traced(lambda a, b: (a - b) * (b - a) * 2.0 + (b * -a))

    assert show(program).splitlines() == [
        "t0 = load q[0]",
        "t1 = load q[1]",
        "t2 = sub t0 t1",
        "t3 = mul t2 t2",
        "t4 = const 2.0",
        "t5 = mul t3 t4",
        "t6 = mul t0 t1",
        "t7 = add t5 t6",
        "t8 = neg t7",
        "out tau[0] = t8",
    ]


@pytest.mark.parametrize(
    ("expression", "same"),
    [
        (lambda a, b: a + 0.0, lambda a, b: a),
        (lambda a, b: 0.0 - a, lambda a, b: -a),
        (lambda a, b: a * 1.0, lambda a, b: a),
        (lambda a, b: a * -1, lambda a, b: -a),
        (lambda a, b: a * 0.0, lambda a, b: 0.0),
        (lambda a, b: a - a, lambda a, b: 0.0),
        (lambda a, b: a + b - b, lambda a, b: a + b - b),
        (lambda a, b: 2.0 * (3.0 * a), lambda a, b: a * 6.0),
        (lambda a, b: 0.5 * (a * 2.0), lambda a, b: a),
        (lambda a, b: a / 4.0, lambda a, b: a * 0.25),
        (lambda a, b: 0.0 / a, lambda a, b: 0.0),
        (lambda a, b: +a, lambda a, b: a),
        (lambda a, b: 0 - (-a), lambda a, b: a),
        (lambda a, b: (-a) / (-b), lambda a, b: a / b),
        (lambda a, b: (-a).sincos()[0], lambda a, b: -(a.sincos()[0])),
        (lambda a, b: (-a).sincos()[1], lambda a, b: a.sincos()[1]),
    ],
)
def test_arithmetic_that_does_nothing_is_not_recorded(expression, same):
    assert drop_unused(traced(expression)) == drop_unused(traced(same))


def test_constants_meet_whatever_their_order():
    program = traced(lambda a, b: (2.0 * a) * 3.0, lambda a, b: 3.0 * (a * 2.0))

    assert cost(program).mul <= 2
    assert program.outputs[0][1] == program.outputs[1][1]


def test_numbers_can_be_put_out():
    program = traced(lambda a, b: -2.5, lambda a, b: -0.0)

    tau = interpret(program, {"q": np.zeros((1, 2))}, {"tau": 2})["tau"]
    np.testing.assert_array_equal(tau, [[-2.5, 0.0]])
    assert not np.signbit(tau[0, 1])


def random_expression(seed: int, values: list) -> list:
    """Grows a list of values by random arithmetic; the same for symbols and for arrays."""
    choose = random.Random(seed)
    values = list(values)
    for _ in range(60):
        a, b = choose.choice(values), choose.choice(values[:4])
        constant = choose.choice([0.0, 1.0, -1, 0.3, -2])
        operation = choose.randrange(8)
        if operation == 0:
            values.append(a + b)
        elif operation == 1:
            values.append(a - b)
        elif operation == 2:
            values.append(a * b)
        elif operation == 3:
            values.append(constant * a)
        elif operation == 4:
            values.append(a + constant)
        elif operation == 5:
            values.append(constant - a)
        elif operation == 6:
            values.append(-a)
        else:
            values.append(_sine(a))
    return values[-3:]


def _sine(value):
    return value.sincos()[0] if isinstance(value, Symbol) else np.sin(value)


@pytest.mark.parametrize("seed", range(40))
def test_a_trace_computes_what_the_numbers_do(seed: int):
    tracer = Tracer()
    inputs = tracer.symbols("q", 4)
    expected = random_expression(seed, list(np.random.default_rng(seed).uniform(-1, 1, (4, 20))))
    stored = [(Slot("tau", i), value) for i, value in enumerate(random_expression(seed, inputs))]

    program = check(tracer.finish(stored))

    q = np.random.default_rng(seed).uniform(-1, 1, (4, 20)).T
    tau = interpret(program, {"q": q}, {"tau": 3})["tau"]
    for i, value in enumerate(expected):
        np.testing.assert_allclose(tau[:, i], value, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("number", [np.float64(-2.0), np.float64(2.0), -2.0, 2])
def test_numpys_numbers_keep_their_sign_in_sums_and_products(number):
    tracer = Tracer()
    (q,) = tracer.symbols("q", 1)
    values = (q + number, q - number, number - q, -q - number, q * number, q / number)
    program = tracer.finish([(Slot("tau", i), value) for i, value in enumerate(values)])
    found = interpret(program, {"q": np.array([3.0])}, {"tau": len(values)})["tau"]
    x = float(number)
    assert found == pytest.approx([3 + x, 3 - x, x - 3, -3 - x, 3 * x, 3 / x])


def test_roots_are_recorded_and_folded():
    program = drop_unused(traced(lambda a, b: (a * a + b * b).root(), lambda a, b: (a * 0.0 + 4.0) * b))
    assert "sqrt" in show(program)
    found = interpret(program, {"q": np.array([3.0, 4.0])}, {"tau": 2})["tau"]
    np.testing.assert_array_equal(found, [5.0, 16.0])
    assert cost(program).div == 1
    tracer = Tracer()
    assert tracer.constant(9.0).root().constant_value() == 3.0


def test_the_root_of_what_is_minus_another_value_is_of_that():
    program = traced(lambda a, b: (b - a).root(), lambda a, b: (a - b) * 2.0)
    found = interpret(program, {"q": np.array([1.0, 10.0])}, {"tau": 2})["tau"]
    np.testing.assert_array_equal(found, [3.0, -18.0])
