"""The table of operations: meaning against mpmath, derivatives against fifty digits, and what NaN and zeros become."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from fifty_digits import MP
from operation_arguments import arguments

from psdmc.program.cost import cost
from psdmc.program.operations import BY_WORD, Unit
from psdmc.program.passes.absorb_negations import absorb_negations
from psdmc.program.passes.fold_constants import fold_constants
from psdmc.program.program import Op, Slot
from psdmc.program.text import parse, show
from psdmc.program.trace import Symbol, Tracer

COMPUTED = [op for op in Op if op.arity]
NEW = (Op.ABS, Op.MIN, Op.MAX, Op.SELECT, Op.EXP, Op.TANH, Op.ATAN2)


@pytest.mark.parametrize("op", COMPUTED)
def test_the_meaning_is_mpmaths(op: Op) -> None:
    x = arguments(op, op.arity if op.arity > 1 else 2)[:, : op.arity]
    with np.errstate(all="ignore"):
        found = op(*x.T)
    checked = 0
    for given, value in zip(x, found, strict=True):
        if not np.all(np.isfinite(given)) or not math.isfinite(value) or 0.0 < abs(value) < 1e-300:
            continue
        if op is Op.ATAN2 and str(given[0]) == "-0.0":
            continue  # mpmath has no negative zero
        with mpmath.workdps(400):
            exact = MP[op](*map(mpmath.mpf, given))
            error = abs(mpmath.mpf(float(value)) - exact) / mpmath.mpf(float(np.spacing(abs(float(exact)))))
        assert error <= op.operation.ulp, f"{op} of {given}: {float(error)} ulp"
        checked += 1
    assert checked > 100


@pytest.mark.parametrize("op", COMPUTED)
def test_a_number_an_array_and_a_folded_constant_are_the_same(op: Op) -> None:
    x = arguments(op, op.arity if op.arity > 1 else 2)[:, : op.arity]
    with np.errstate(all="ignore"):
        found = op(*x.T)
    for given, value in zip(x, found, strict=True):
        folded = op.of_numbers(list(map(float, given)))
        assert folded == value if math.isfinite(value) else folded is None


@pytest.mark.parametrize("op", COMPUTED)
def test_partial_derivatives_are_differences_of_fifty_digits(op: Op) -> None:
    random = np.random.default_rng(5)
    for _ in range(20):
        given = [float(each) for each in random.uniform(0.2, 2.0, op.arity)]
        partials = op.operation.partials(op(*given), *given)
        assert len(partials) == op.arity
        with mpmath.workdps(50):
            step = mpmath.mpf(10) ** -16
            for k, partial in enumerate(partials):
                sides = [
                    MP[op](*(mpmath.mpf(x) + (sign * step if i == k else 0) for i, x in enumerate(given)))
                    for sign in (1, -1)
                ]
                assert float(partial) == pytest.approx(
                    float((sides[0] - sides[1]) / (2 * step)), rel=1e-13, abs=1e-14
                )


NAN = math.nan


@pytest.mark.parametrize(
    ("op", "given", "wanted"),
    [
        (Op.MIN, (NAN, 1.0), NAN),
        (Op.MIN, (1.0, NAN), NAN),
        (Op.MAX, (NAN, 1.0), NAN),
        (Op.MAX, (1.0, NAN), NAN),
        (Op.MIN, (0.0, -0.0), -0.0),
        (Op.MIN, (-0.0, 0.0), 0.0),
        (Op.MAX, (0.0, -0.0), -0.0),
        (Op.MAX, (-0.0, 0.0), 0.0),
        (Op.ABS, (-0.0,), 0.0),
        (Op.ABS, (NAN,), NAN),
        (Op.SELECT, (NAN, 1.0, 2.0, 3.0), 3.0),
        (Op.SELECT, (1.0, NAN, 2.0, 3.0), 3.0),
        (Op.SELECT, (-0.0, 0.0, 2.0, 3.0), 3.0),
        (Op.SELECT, (0.0, 1.0, 2.0, NAN), 2.0),
        (Op.ATAN2, (-0.0, -1.0), -math.pi),
        (Op.ATAN2, (0.0, -0.0), math.pi),
        (Op.EXP, (-math.inf,), 0.0),
        (Op.TANH, (math.inf,), 1.0),
    ],
)
def test_nan_and_zeros_become_what_the_table_says(op: Op, given: tuple[float, ...], wanted: float) -> None:
    np.testing.assert_equal(float(op(*given)), wanted)
    np.testing.assert_equal(float(op(*(np.array([x]) for x in given))[0]), wanted)


@pytest.mark.parametrize("op", NEW)
def test_text_reads_back(op: Op) -> None:
    names = [f"t{k}" for k in range(op.arity)]
    text = "\n".join(
        [
            *(f"t{k} = load q[{k}]" for k in range(op.arity)),
            f"t{op.arity} = {op} {' '.join(names)}",
            f"out tau[0] = t{op.arity}",
        ]
    )
    assert show(parse(text)) == text
    with pytest.raises(ValueError, match=f"{op} takes {op.arity} arguments"):
        parse(text.replace(f"{op} t0", f"{op} t0 t0"))


def recorded(op: Op, signs: tuple[int, ...]) -> list[str]:
    tracer = Tracer()
    given = [
        symbol if sign > 0 else -symbol
        for symbol, sign in zip(tracer.symbols("q", op.arity), signs, strict=True)
    ]
    return show(tracer.finish([(Slot("tau", 0), op(*given))])).splitlines()[op.arity : -1]


@pytest.mark.parametrize(
    ("op", "signs", "wanted"),
    [
        (Op.ABS, (-1,), ["t1 = abs t0"]),
        (Op.TANH, (-1,), ["t1 = tanh t0", "t2 = neg t1"]),
        (Op.EXP, (-1,), ["t1 = neg t0", "t2 = exp t1"]),
        (Op.ATAN2, (-1, 1), ["t2 = atan2 t0 t1", "t3 = neg t2"]),
        (Op.ATAN2, (1, -1), ["t2 = neg t1", "t3 = atan2 t0 t2"]),
        (Op.MIN, (1, -1), ["t2 = neg t1", "t3 = min t0 t2"]),
        (Op.SELECT, (1, 1, 1, -1), ["t4 = neg t3", "t5 = select t0 t1 t2 t4"]),
    ],
)
def test_symbols_keep_signs_beside_values_where_the_operation_lets_them(
    op: Op, signs: tuple[int, ...], wanted: list[str]
) -> None:
    assert recorded(op, signs) == wanted


def test_symbols_record_equal_operations_once_and_fold_constants() -> None:
    tracer = Tracer()
    a, b = tracer.symbols("q", 2)
    assert Op.MIN(a, b).index == Op.MIN(b, a).index
    assert Op.ATAN2(a, b).index != Op.ATAN2(b, a).index
    folded = Op.EXP(tracer.constant(1.0))
    assert isinstance(folded, Symbol)
    assert folded.constant_value() == math.e


def test_what_is_not_finite_is_not_folded() -> None:
    text = "t0 = const 1000.0\nt1 = exp t0\nt2 = const -1.0\nt3 = sqrt t2\nout tau[0] = t1\nout tau[1] = t3"
    assert show(fold_constants(parse(text))) == text


def test_an_even_operation_absorbs_a_sign() -> None:
    before = parse("t0 = load q[0]\nt1 = neg t0\nt2 = abs t1\nt3 = cos t1\nout tau[0] = t2\nout tau[1] = t3")
    assert show(absorb_negations(before)).splitlines()[:-2] == [
        "t0 = load q[0]",
        "t1 = abs t0",
        "t2 = cos t0",
    ]


def test_choices_and_calls_are_counted_apart() -> None:
    program = parse("a = load q[0]\nb = abs a\nc = min a b\nd = tanh c\ne = select a b c d\nout tau[0] = e")
    assert (cost(program).choice, cost(program).call, cost(program).total) == (3, 1, 0)
    assert str(cost(program)) == "0 mul + 0 add + 0 sincos + 3 choice + 1 call"


def test_every_operation_is_complete() -> None:
    assert list(BY_WORD.values()) == list(Op)
    assert set(MP) == set(COMPUTED)
    assert all((op.unit in (Unit.NONE, Unit.LOAD)) is (op.arity == 0) for op in Op)
