"""Dimensions of values, operation by operation."""

from __future__ import annotations

import pytest

from psdmc.errors import InternalError
from psdmc.lower.dimension_check import DimensionedTracer, UnlikeArguments
from psdmc.program.dimensions import Dimension, dimension_of
from psdmc.program.program import Op, Slot

UNITS = {"a": "m", "b": "m", "f": "N", "p": "rad", "r": "1", "k": "kg m^2"}

RULES = [
    (Op.ADD, "ab", "m"),
    (Op.SUB, "ab", "m"),
    (Op.MUL, "fa", "J"),
    (Op.DIV, "fa", "kg/s^2"),
    (Op.NEG, "a", "m"),
    (Op.SIN, "p", "1"),
    (Op.COS, "p", "1"),
    (Op.ABS, "f", "N"),
    (Op.MIN, "ab", "m"),
    (Op.MAX, "ab", "m"),
    (Op.SELECT, "abff", "N"),
    (Op.EXP, "r", "1"),
    (Op.TANH, "r", "1"),
    (Op.LOG, "r", "1"),
    (Op.POW, "rp", "1"),
    (Op.ATAN2, "ab", "1"),
]

UNLIKE = [
    (Op.ADD, "af", "sum of m and kg m/s^2"),
    (Op.SUB, "ap", "difference of m and a number"),
    (Op.SIN, "a", "sin of m"),
    (Op.COS, "a", "cos of m"),
    (Op.MIN, "ak", "minimum of m and kg m^2"),
    (Op.MAX, "ra", "maximum of m and a number"),
    (Op.SELECT, "afab", "choice of m and kg m/s^2"),
    (Op.SELECT, "abaf", "choice of m and kg m/s^2"),
    (Op.EXP, "a", "exp of m"),
    (Op.TANH, "f", "tanh of kg m/s^2"),
    (Op.LOG, "a", "log of m"),
    (Op.POW, "ar", "pow of m and a number"),
    (Op.POW, "ra", "pow of a number and m"),
    (Op.ATAN2, "af", "atan2 of m and kg m/s^2"),
]


def symbols(tracer: DimensionedTracer) -> dict:
    return {name: tracer.measured(Slot(name, 0), dimension_of(unit)) for name, unit in UNITS.items()}


def taken(op: Op, arguments: list):
    return op(*arguments) if op.written else arguments[0].tracer.operated(op, arguments)


def test_every_operation_has_a_rule_that_is_tried() -> None:
    assert {op for op, _, _ in RULES} == set(Op) - {Op.LOAD, Op.CONST, Op.SQRT}


@pytest.mark.parametrize(("op", "arguments", "unit"), RULES)
def test_values_have_the_dimension_of_their_operation(op, arguments, unit) -> None:
    tracer = DimensionedTracer()
    own = symbols(tracer)
    assert tracer.dimension(taken(op, [own[name] for name in arguments])) == dimension_of(unit)


@pytest.mark.parametrize(("op", "arguments", "words"), UNLIKE)
def test_unlike_arguments_are_an_error_that_names_both(op, arguments, words) -> None:
    own = symbols(DimensionedTracer())
    with pytest.raises(UnlikeArguments, match=f"^{words.replace('^', r'.')}$"):
        taken(op, [own[name] for name in arguments])


def test_roots_and_powers_divide_and_multiply_exponents() -> None:
    tracer = DimensionedTracer()
    a, k = (symbols(tracer)[name] for name in "ak")
    assert tracer.dimension(k.root() * k.root()) == dimension_of("kg m^2")
    assert tracer.dimension((a * a).root()) == dimension_of("m")
    assert str(tracer.dimension(a.root())) == "m^0.5"
    assert tracer.dimension(Op.POW(a, 3.0)) == dimension_of("m^3")


def test_numbers_have_no_unit_and_zero_has_any() -> None:
    tracer = DimensionedTracer()
    a = symbols(tracer)["a"]
    assert tracer.dimension(2.0 * a - 0.0) == dimension_of("m")
    assert tracer.dimension(Op.MAX(a, 0.0)) == dimension_of("m")
    assert tracer.dimension(Op.SELECT(0.0, a, a, 0.0)) == dimension_of("m")
    with pytest.raises(UnlikeArguments, match="sum of m and a number"):
        a + 1.0
    with pytest.raises(UnlikeArguments, match="difference of m and a number"):
        1.0 - a


@pytest.mark.parametrize(
    ("unit", "dimension", "words"),
    [
        ("J", (1, 2, -2), "kg m^2/s^2"),
        ("N m", (1, 2, -2), "kg m^2/s^2"),
        ("1/(J s^2)", (-1, -2, 0), "1/(kg m^2)"),
        ("rad/s", (0, 0, -1), "1/s"),
        ("W", (1, 2, -3), "kg m^2/s^3"),
        ("1", (0, 0, 0), "1"),
    ],
)
def test_units_are_read_and_written(unit, dimension, words) -> None:
    assert dimension_of(unit) == dimension
    assert str(dimension_of(unit)) == words
    assert dimension_of(words) == dimension


@pytest.mark.parametrize("unit", ["", "Nm", "m/s/s", "m**2", "mm"])
def test_other_words_are_no_unit(unit) -> None:
    with pytest.raises(InternalError, match="unit"):
        dimension_of(unit)


def test_orders_are_those_of_a_unit_of_length_with_energies_kept() -> None:
    assert [Dimension(*exponents).order for exponents in ((1, 2, -2), (1, 1, -2), (0, 1, 0), (1, 0, 0))] == [
        0,
        1,
        -1,
        2,
    ]
