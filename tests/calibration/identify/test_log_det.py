"""The nearest positive definite matrices of a family: closed forms, and families that have none."""

from __future__ import annotations

import numpy as np
import pytest

from psdmc.links.log_det import Block, feasible_point, nearest_definite


def block(
    constant: list[list[float]], *slopes: list[list[float]], near: float = 1.0, weight: float = 1.0
) -> Block:
    size = len(constant)
    return Block(np.array(constant), np.array(slopes).reshape(-1, size, size), near * np.eye(size), weight)


@pytest.mark.parametrize("near", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("begin", [-1e3, 1e-3, 10.0])
def test_one_number_becomes_what_it_should_resemble(near: float, begin: float) -> None:
    """z / near - log z is least at z = near."""
    found = nearest_definite([block([[0.0]], [[1.0]], near=near)], np.array([begin * near]))
    assert found == pytest.approx(near, rel=1e-12)


def test_a_matrix_with_one_free_entry() -> None:
    """P = [[2, z], [z, 3]], N = 1: 5 - log(6 - z^2) is least at z = 0."""
    found = nearest_definite([block([[2.0, 0.0], [0.0, 3.0]], [[0.0, 1.0], [1.0, 0.0]])], np.array([50.0]))
    assert found == pytest.approx(0.0, abs=1e-12)


def test_two_numbers_of_one_sum_share_it_by_their_weights() -> None:
    """w1 (z - log z) + w2 ((1 - z) - log(1 - z)): at w1 (1 - 1/z) = w2 (1 - 1/(1 - z))."""
    first, second = block([[0.0]], [[1.0]], weight=2.0), block([[1.0]], [[-1.0]], weight=0.5)
    found = nearest_definite([first, second], np.array([0.5]))
    assert found is not None
    z = float(found[0])
    assert 2.0 * (1.0 - 1.0 / z) == pytest.approx(0.5 * (1.0 - 1.0 / (1.0 - z)), rel=1e-10)


@pytest.mark.parametrize("gap", [1.0, 1e-3])
def test_a_family_without_positive_matrices(gap: float) -> None:
    """z and -gap - z are never both positive."""
    assert feasible_point([block([[0.0]], [[1.0]]), block([[-gap]], [[-1.0]])], np.array([3.0])) is None


@pytest.mark.parametrize("width", [1.0, 1e-3, 1e-6])
def test_a_thin_family_is_found(width: float) -> None:
    """z and width - z are both positive between."""
    found = feasible_point([block([[0.0]], [[1.0]]), block([[width]], [[-1.0]])], np.array([1e3]))
    assert found is not None
    assert 0.0 < found[0] < width
