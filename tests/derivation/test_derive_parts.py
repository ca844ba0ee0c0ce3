"""The derivation's steps, each by itself."""

from __future__ import annotations

import numpy as np
import pytest
from bundled import bundled_model
from random_chains import random_chain

from psdmc.derivation.base_parameters import reduced
from psdmc.derivation.derive import derive_model
from psdmc.derivation.from_callable import row_space
from psdmc.derivation.interpolate import along_axes, evaluation, interpolation, nodes, quadratic_basis
from psdmc.derivation.mass_matrix import derivative, slope_count
from psdmc.derivation.memory import grid_bytes, largest_monomial_count, velocity_bytes
from psdmc.derivation.monomials import Monomials, Terms, merged, summed, times_matrix
from psdmc.errors import DerivationError
from psdmc.robot.joints import PRISMATIC, REVOLUTE, JointType


def terms(*entries: tuple[int, int, int, float]) -> Terms:
    row, monomial, column, value = zip(*entries, strict=True)
    return Terms(np.array(row), np.array(monomial), np.array(column), np.array(value))


def test_a_product_of_two_linear_polynomials_interpolates_to_its_coefficients() -> None:
    """(1 + 2 s)(3 c - s) = 3 c - s + 6 s c - 2 + 2 c^2, times q2 * q2."""
    first, second = np.array([1.0, 2.0, 0.0]), np.array([0.0, -1.0, 3.0])
    slide = np.array([0.0, 1.0])
    types = (REVOLUTE, PRISMATIC)
    matrices = [evaluation(kind) for kind in types]
    values = [along_axes(matrices, np.outer(a, slide).reshape(-1, 1)) for a in (first, second)]
    product = values[0] * values[1]
    found = along_axes([interpolation(kind) for kind in types], product.T).reshape(5, 3)
    assert np.allclose(found[:, 2], [-2.0, -1.0, 3.0, 6.0, 2.0], atol=1e-14)
    assert np.allclose(found[:, :2], 0.0, atol=1e-14)


@pytest.mark.parametrize("kind", [REVOLUTE, PRISMATIC])
def test_the_derivative_in_coefficient_space_is_the_derivative(kind: JointType) -> None:
    monomials = Monomials((REVOLUTE, kind))
    count = len(nodes(kind))
    coefficients = np.random.default_rng(0).normal(size=count)
    given = terms(*((0, 10 + digit, 0, value) for digit, value in enumerate(coefficients)))
    slope = derivative(given, monomials, 1)
    assert slope_count(given, monomials, 1) == len(slope.value)
    q, h = np.array([0.3, -1.1]), 1e-6
    expected = (quadratic_basis(kind, q + h) - quadratic_basis(kind, q - h)) @ coefficients / (2 * h)
    assert (slope.monomial // 5 == 2).all()
    found = quadratic_basis(kind, q)[:, slope.monomial % 5] @ slope.value
    assert np.allclose(found, expected, atol=1e-8)


def test_columns_of_E_stand_in_the_documented_order() -> None:
    model = bundled_model("two_link_full")
    blocks = model.E.reshape(5, 2, -1).astype(int)
    speeds, accelerations = blocks[3], blocks[4]
    section = np.select(
        [accelerations.any(axis=0), (speeds == 2).any(axis=0), speeds.any(axis=0)], [1, 2, 3], 0
    )
    assert (np.diff(section) >= 0).all()
    digit = np.where(blocks[2] == 2, 4, blocks[1] + 2 * blocks[2])
    code = 5 * digit[0] + digit[1]
    rate = np.argmax(accelerations, axis=0) + 10 * np.argmax(speeds, axis=0)
    keys = list(zip(section.tolist(), rate.tolist(), code.tolist(), strict=True))
    assert keys == sorted(keys)
    assert len(set(keys)) == model.p


def test_no_function_is_left_without_a_coefficient() -> None:
    model = bundled_model("kr6")
    used = np.unique(np.concatenate([matrix.tocoo().coords[0] for matrix in model.P]))
    assert len(used) == model.p
    assert all((matrix.data != 0).all() for matrix in model.P)


def test_terms_are_summed_sorted_and_cleaned() -> None:
    given = terms((1, 5, 0, 2.0), (0, 7, 1, 1.0), (1, 5, 0, -0.5), (0, 7, 1, -1.0 + 1e-14))
    found = summed(given, 1e-12)
    assert [part.tolist() for part in found] == [[1], [5], [0], [1.5]]


def test_terms_times_a_matrix() -> None:
    given = terms((0, 3, 0, 2.0), (0, 3, 1, 1.0), (0, 4, 1, 5.0))
    found = times_matrix(given, np.array([[1.0, 0.0], [-2.0, 3.0]]), 1e-12)
    assert [part.tolist() for part in found] == [[0, 0, 0], [3, 4, 4], [1, 0, 1], [3.0, -10.0, 15.0]]


def test_pivots_come_in_order_and_not_by_size() -> None:
    factor = np.array([[1.0, 2.0, 0.0, 1.0], [0.0, 0.0, 1000.0, 5.0]])
    found = reduced(factor)
    assert found.pivots.tolist() == [0, 2]
    assert np.allclose(found.echelon, [[1.0, 2.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.005]], atol=1e-15)


def test_a_nearly_dependent_column_waits_for_a_later_pass() -> None:
    """Column 1 is new by a thousandth only; column 2 spans the same and is clear."""
    factor = np.array([[1.0, 1.0, 0.0], [0.0, 1e-3, 1.0]])
    assert reduced(factor).pivots.tolist() == [0, 2]
    assert reduced(factor[:, :2]).pivots.tolist() == [0, 1]


def test_columns_of_rounding_are_no_pivots() -> None:
    factor = np.array([[1.0, 1e-17, 0.0], [0.0, 3e-17, 2.0]])
    assert reduced(factor).pivots.tolist() == [0, 2]


def test_row_space_in_blocks_is_that_of_the_whole() -> None:
    rng = np.random.default_rng(2)
    dense = rng.normal(size=(40, 6)) * (rng.random((40, 6)) < 0.4)
    row, column = np.nonzero(dense)
    whole = Terms(np.zeros(len(row), dtype=np.int64), row, column, dense[row, column])
    factor = row_space(whole, 6)
    assert np.allclose(factor.T @ factor, dense.T @ dense)
    assert np.allclose(np.abs(factor), np.abs(np.linalg.qr(dense, mode="r")))


def test_values_that_differ_by_rounding_become_the_simple_one() -> None:
    values = np.array([0.005625000000000001, -0.0056249999999999998, 1.0000000000000002, 1 / 3, 2.0])
    found = merged(values, np.full(5, 1e-14))
    assert found.tolist() == [0.005625, -0.005625, 1.0, 1 / 3, 2.0]


def test_values_that_are_no_decimals_become_one_too() -> None:
    found = merged(np.array([1 / 3, 1 / 3 + 1e-15, -1 / 3 + 1e-15]), np.full(3, 1e-14))
    assert len(set(np.abs(found).tolist())) == 1
    assert np.signbit(found).tolist() == [False, False, True]


def test_values_further_apart_than_rounding_stay() -> None:
    values = np.array([0.1, 0.1 + 1e-11, np.pi, -np.pi * (1 + 1e-10)])
    assert np.array_equal(merged(values, np.full(4, 1e-14)), values)


@pytest.mark.parametrize("kinds", ["RRR", "RPR", "RRRR", "PRRR"])
def test_the_bound_on_p_holds_and_is_near(kinds: str) -> None:
    chain = random_chain(0, kinds)
    p = derive_model(chain).p
    bound = largest_monomial_count(chain.types)
    assert p <= bound
    assert kinds != "RRRR" or p > 0.8 * bound


def test_expansion_beyond_memory_is_refused_before_it_is_made() -> None:
    with pytest.raises(DerivationError, match=r"2-joint .* monomials and about .* GiB") as caught:
        derive_model(random_chain(0, "RR"), memory=100)
    assert "--no-expand" in caught.value.hint


def test_velocity_terms_beyond_memory_are_refused() -> None:
    """The grid fits, the velocity terms do not: their number is known once the mass matrix is."""
    chain, steps = random_chain(0, "RRRRRR"), []
    with pytest.raises(DerivationError, match="6-joint"):
        derive_model(chain, memory=grid_bytes([REVOLUTE] * 6), progress=steps.append)
    assert steps[-1] == "velocity terms"


def test_terms_are_counted_before_they_are_made() -> None:
    monomials = Monomials((REVOLUTE, REVOLUTE))
    mass = {(0, 0): terms((0, 3, 0, 1.0), (0, 0, 0, 1.0)), (0, 1): terms((0, 1, 0, 1.0))}
    count, _ = velocity_bytes(mass, monomials, ((1,), ()))
    assert count == 2 * 2 + 3


def test_a_robot_without_any_effect_is_refused() -> None:
    chain = random_chain(0, "R")
    empty = type(chain)(
        chain.name,
        chain.convention,
        chain.base_name,
        chain.tip_name,
        chain.joints,
        np.zeros((1, 11)),
        np.zeros((11, 0)),
        chain.gravity,
        chain.tip,
    )
    with pytest.raises(DerivationError, match="no inertial parameter"):
        derive_model(empty)
