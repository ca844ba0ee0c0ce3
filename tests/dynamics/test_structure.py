"""Which entries of matrices can differ from zero, against values at many states and against what branches imply."""

from __future__ import annotations

import numpy as np
import pytest
from random_trees import RandomTree

from psdmc.derivation.derive import derive_model
from psdmc.dynamics.structure import SOMETHING, Places, mass_matrix_places, regressor_places
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.robot.mechanism import Mechanism

TREES = {
    "a chain": ((-1, 0, 1, 2, 3), "RPRRP", 0.0),
    "a chain with right angles": ((-1, 0, 1, 2, 3), "RPRRP", 0.7),
    "branches on the base": ((-1, 0, -1, 2, 2), "RRPRR", 0.5),
    "a floating base": ((-1, 0, 1, 0, 3, 0), "FRRRPR", 0.0),
    "a floating base, right angles": ((-1, 0, 1, 0, 3, 0), "FRRRPR", 0.7),
    "joints of several coordinates": ((-1, 0, 1, 0, 3), "LSRTR", 0.3),
}
STATES = 100
ZERO = 1e-12
"""Of the largest entry: what differs from zero by rounding alone."""
ROUNDED = 4
"""Entries of these regressors that right angles make zero and the link frames' arbitrary turns leave at 1e-16."""


def model_of(name: str) -> DynamicsModel:
    return derive_model(RandomTree(3, *TREES[name]).mechanism(), expand=False)


def entries(places: Places, shape: tuple[int, ...]) -> np.ndarray:
    found = np.zeros(shape, dtype=bool)
    found[tuple(np.array(places).T)] = True
    return found


def sometimes(values: np.ndarray) -> np.ndarray:
    return np.asarray(np.abs(values).max(axis=0) > ZERO * np.abs(values).max())


@pytest.mark.parametrize("name", TREES)
def test_entries_are_those_that_some_state_shows(name: str) -> None:
    model = model_of(name)
    q, qd, qdd = states_of(model.mechanism, np.random.default_rng(0), STATES)
    M, Y = sometimes(model.mass_matrix(q)), sometimes(model.regressor(q, qd, qdd))

    mass = entries(mass_matrix_places(model.mechanism, model.representative), M.shape)
    rows = entries(regressor_places(model.mechanism, model.representative), Y.shape)

    assert np.array_equal(mass, np.tril(M))
    assert not np.any(Y & ~rows)
    assert np.sum(rows & ~Y) <= (ROUNDED if TREES[name][2] else 0)


def related(robot: Mechanism) -> np.ndarray:
    """(nv, nv) whether one rate's joint carries the other's."""
    paths = [set(robot.path_to(joint)) for joint in robot.rate_joints]
    return np.array([[own <= other or other <= own for other in paths] for own in paths])


@pytest.mark.parametrize("name", TREES)
def test_no_branch_sees_another(name: str) -> None:
    model = model_of(name)
    found = mass_matrix_places(model.mechanism, model.representative)
    assert not np.any(entries(found, (model.nv, model.nv)) & ~related(model.mechanism))


@pytest.mark.parametrize("name", TREES)
def test_rows_ascend_and_the_diagonal_ends_each(name: str) -> None:
    """So the triangle is one in compressed rows, and the upper triangle in compressed columns."""
    model = model_of(name)
    found = mass_matrix_places(model.mechanism, model.representative)
    assert list(found) == sorted(found)
    assert dict(found) == {i: i for i in range(model.nv)}


def test_what_may_differ_from_zero_does_so_unless_it_is_multiplied_by_zero() -> None:
    x = SOMETHING
    assert x * 0.0 == 0.0 == 0.0 * x == 0.0 / x
    for value in (
        x * 2.0,
        2.0 * x,
        x + 0.0,
        0.0 - x,
        x * x,
        x - x,
        -x,
        x / 2.0,
        1.0 / x,
        np.float64(2.0) * x,
    ):
        assert value is SOMETHING
