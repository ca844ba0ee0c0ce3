"""The packed second derivatives of the weighted torques: entries of the dense matrix, and all that can differ from zero."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, SEVERAL, bench, matches_pinocchio
from wide_robots import wide_robot

from psdmc.functions import RECIPES

DENSE = "inverse_dynamics_second_derivatives"
NAME = f"{DENSE}_packed"


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio(NAME, robot, real)


def test_it_has_the_dense_matrix_s_numbers() -> None:
    own = bench(ARM)
    states = [own.given[quantity.name] for quantity in RECIPES[NAME].signature.inputs]
    rows, columns = own.robot.pattern(NAME)
    assert (rows >= columns).all()
    np.testing.assert_array_equal(
        getattr(own.robot, NAME)(*states), getattr(own.robot, DENSE)(*states)[:, rows, columns]
    )


@pytest.mark.parametrize("name", ["free", "planar", "hand"])
def test_what_is_left_out_is_zero(name: str) -> None:
    """Of trees, whose branches meet in few entries."""
    own = wide_robot(name)
    packing = RECIPES[NAME].packs
    assert packing is not None
    dense = RECIPES[DENSE].reference(own.arrays, own.given)["hessian"]
    kept = np.zeros(dense.shape[1:], dtype=bool)
    kept[tuple(np.array(packing.places(own.model.mechanism, own.model.representative)).T)] = True
    lower = np.tril(np.ones_like(kept))
    assert np.abs(dense[:, (lower > 0) & ~kept]).max(initial=0.0) <= 1e-13 * np.abs(dense).max()
    used = (np.abs(dense) > 1e-9 * np.abs(dense).max()).any(axis=0) & (lower > 0)
    assert kept.sum() <= 1.25 * used.sum()
