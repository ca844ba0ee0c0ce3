"""The parts of the expanded lowering: constants, terms to diagrams, diagrams to values."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.lower.expanded.diagram import Constants, Diagram, nested_horner, operations, with_constants
from psdmc.lower.expanded.lowering import base_first, candidates, polynomial_values, tip_first
from psdmc.lower.expanded.terms import Terms
from psdmc.program.cost import cost
from psdmc.program.passes.drop_unused import drop_unused
from psdmc.program.program import Slot
from psdmc.program.trace import Tracer


def merged(values: list[float], uncertainty: list[float]) -> list[float]:
    return Constants().merged(np.array(values), np.array(uncertainty)).tolist()


def test_values_closer_than_their_uncertainty_become_the_most_certain_one():
    assert merged([3.0, -3.0 - 1e-12, 3.1], [1e-14, 1e-12, 1e-12]) == [3.0, -3.0, 3.1]
    assert merged([3.0, 3.0 + 1e-12], [9e-13, 2e-13]) == [3.0 + 1e-12, 3.0 + 1e-12]


def test_certain_values_stay_apart_whatever_lies_between():
    apart = merged([3.0, 3.0 + 5e-10, 3.0 + 1e-9], [1e-13, 1e-9, 1e-13])

    assert apart[0] == 3.0
    assert apart[2] == 3.0 + 1e-9
    assert apart[1] in (apart[0], apart[2])


def test_what_may_be_one_half_one_or_two_is():
    assert merged([1.0 + 1e-13, -2.0 + 1e-13, 0.5 - 1e-14, 1.0 + 1e-9], [1e-13] * 4) == [
        1.0,
        -2.0,
        0.5,
        1 + 1e-9,
    ]


def test_a_certain_value_is_not_replaced_by_a_doubtful_one_from_before():
    constants = Constants()
    constants.merged(np.array([3.0 + 1e-8]), np.array([1e-7]))

    assert constants.merged(np.array([3.0]), np.array([1e-13])) == 3.0


def test_a_value_as_doubtful_as_itself_draws_no_smaller_one_to_it():
    """Coefficients of 3e-20 became 2e-10: nonlinear effects of a robot of many scales were wrong by 4e-4."""
    small, large = merged([3.6e-20, 1.7e-10], [0.82, 0.81])

    assert abs(small - 3.6e-20) <= (0.82 + 0.81) * 3.6e-20
    assert abs(large - 1.7e-10) <= (0.82 + 0.81) * 1.7e-10


@pytest.mark.parametrize("seed", range(20))
def test_no_value_moves_by_more_than_doubts_of_its_own_size(seed: int) -> None:
    """Its own doubt, and that of the value it becomes, which is at most ten times as large."""
    rng = np.random.default_rng(seed)
    values, doubts = 10.0 ** rng.uniform(-20, 3, 400), 10.0 ** rng.uniform(-3, 0.2, 400)
    moved = np.abs(Constants().merged(values, doubts) - values)

    assert np.all(moved <= 11.0 * np.maximum(doubts, 1e-15) * values)


def terms(*monomials: tuple[int, list[int], float]) -> Terms:
    """Terms from (output, exponents, coefficient)."""
    output, exponents, coefficient = zip(*monomials, strict=True)
    values = np.array(coefficient)
    return Terms(np.array(output), np.array(exponents, dtype=np.uint8).T, values, 1e-13 * np.abs(values))


def written(diagram: Diagram, names: str) -> dict[int, str]:
    """Each polynomial as an expression, nested as the diagram nests it."""
    text = {0: "", 1: "1"}
    for level in diagram.levels:
        for number, (child, ratio) in enumerate(
            zip(level.child, level.ratio, strict=True), start=level.first
        ):
            pairs = enumerate(zip(child, ratio, strict=True))
            parts = [f"{r:g} {text[c]} {names[level.row]}^{k}" for k, (c, r) in pairs if c]
            text[number] = "(" + " + ".join(parts) + ")"
    roots = zip(diagram.output, diagram.factor, diagram.root, strict=True)
    return {int(output): f"{factor:g} {text[root]}" for output, factor, root in roots}


def test_terms_that_agree_in_the_remaining_rows_become_a_polynomial_in_the_row():
    # 6 x^2 y + 3 x y + 4 x^2 + 2 x: both powers of x share 3 y + 2
    given = terms((0, [2, 1], 6.0), (0, [1, 1], 3.0), (0, [2, 0], 4.0), (0, [1, 0], 2.0))

    diagram = nested_horner(given, (0, 1))

    assert written(diagram, "xy") == {
        0: "6 (0.5 (0.666667 1 y^0 + 1 1 y^1) x^1 + 1 (0.666667 1 y^0 + 1 1 y^1) x^2)"
    }
    assert operations(diagram) == (4, 2)


def test_parts_that_are_equal_up_to_a_factor_are_one_node_across_outputs():
    given = terms((0, [1, 1], 1.0), (0, [1, 0], 3.0), (1, [0, 1], -2.0), (1, [0, 0], -6.0))

    diagram = nested_horner(given, (0, 1))

    assert [len(level.child) for level in diagram.levels] == [1, 1]
    assert diagram.factor.tolist() == [1.0, -2.0]


def random_terms(seed: int, rows: int = 6, count: int = 200) -> Terms:
    """Three polynomials whose coefficients take few values, so that much is equal."""
    rng = np.random.default_rng(seed)
    exponents = rng.integers(0, 3, (rows, count)) * rng.integers(0, 2, (rows, count))
    keyed = np.unique(np.concatenate([rng.integers(0, 3, (1, count)), exponents]), axis=1)
    coefficient = rng.choice([1.0, -1.0, 2.5, -0.3, 7.0], keyed.shape[1])
    uncertainty = 1e-13 * np.abs(coefficient)
    return Terms(keyed[0], keyed[1:].astype(np.uint8), coefficient, uncertainty)


def summed(given: Terms, rows: np.ndarray) -> dict[int, np.ndarray]:
    """The polynomials' values straight from their terms, at (r, k) values of the rows."""
    products = given.coefficient[:, None] * np.prod(rows[:, None] ** given.exponents[:, :, None], axis=0)
    return {int(k): products[given.output == k].sum(axis=0) for k in np.unique(given.output)}


@pytest.mark.parametrize("seed", range(10))
def test_a_diagram_computes_what_its_terms_say_in_any_order_of_rows(seed: int):
    given, rng = random_terms(seed), np.random.default_rng(seed)
    rows = rng.uniform(-1, 1, (6, 20))

    diagram = nested_horner(given, rng.permutation(6).tolist())

    values, expected = polynomial_values(diagram, list(rows)), summed(given, rows)
    assert sorted(values) == sorted(expected)
    for output, value in expected.items():
        np.testing.assert_allclose(values[output], value, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(10))
def test_rows_can_become_constants_afterwards(seed: int):
    given, rng = random_terms(seed), np.random.default_rng(seed)
    rows = rng.uniform(-1, 1, (6, 20))
    rows[4:] = [[2.5], [0.0]]

    diagram = with_constants(nested_horner(given, range(6)), {4: 2.5, 5: 0.0})

    assert all(level.row < 4 for level in diagram.levels)
    values, expected = polynomial_values(diagram, list(rows)), summed(given, rows)
    for output, value in expected.items():
        np.testing.assert_allclose(values[output], value, rtol=1e-12, atol=1e-12)


def test_no_terms_make_no_polynomials():
    nothing = random_terms(0).where(np.zeros(len(random_terms(0)), dtype=bool))

    diagram = nested_horner(nothing, range(6))

    assert polynomial_values(diagram, [1.0] * 6) == {}
    assert operations(diagram) == (0, 0)


def test_only_innermost_rows_can_become_constants():
    with pytest.raises(ValueError, match="innermost"):
        with_constants(nested_horner(random_terms(0), range(6)), {0: 1.0})


@pytest.mark.parametrize("seed", range(10))
def test_the_estimate_of_operations_is_close_to_what_is_traced(seed: int):
    diagram = nested_horner(random_terms(seed), range(6))
    tracer = Tracer()
    values = polynomial_values(diagram, tracer.symbols("q", 6))
    traced = cost(drop_unused(tracer.finish([(Slot("tau", k), value) for k, value in values.items()])))

    multiplications, additions = operations(diagram)

    # the tracer shares some sums besides whole nodes
    assert 0.85 * multiplications <= traced.mul <= multiplications
    assert 0.95 * additions <= traced.add <= additions


@pytest.mark.parametrize("joints", [base_first(3), tip_first(3)])
def test_candidate_orders_take_every_row_once_and_parameters_innermost(joints: tuple[int, ...]):
    orders = list(candidates(joints, rows=19))

    assert len(set(orders)) == len(orders) == 6
    for order in orders:
        assert sorted(order) == list(range(19))
        assert order[15:] == (15, 16, 17, 18)
        position = [row % 3 for row in order if row // 3 in (0, 1, 2)]
        assert position == [joint for joint in joints for _ in range(3)]


def test_terms_of_different_lengths_are_refused():
    with pytest.raises(ValueError, match="differ in length"):
        Terms(np.zeros(2, dtype=np.int64), np.zeros((3, 2), dtype=np.uint8), np.ones(1), np.ones(2))
