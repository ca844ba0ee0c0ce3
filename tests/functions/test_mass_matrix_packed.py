"""The packed mass matrix against Pinocchio's, and as what sparse solvers read."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import EVERY, matches_pinocchio
from pinocchio_robots import path_of
from scipy.sparse import csc_matrix, csr_matrix
from unoptimised import without_optimisation

import psdmc
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.toolchain.call import CompiledRobot

COUNT = 9
EXACT = 1e-13


@pytest.mark.parametrize(("robot", "real"), EVERY)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("mass_matrix_packed", robot, real)


@cache
def quadruped() -> tuple[DynamicsModel, CompiledRobot, np.ndarray]:
    model = psdmc.derive(path_of("solo12"), floating=True)
    with without_optimisation():
        robot = psdmc.compile(model, functions=["mass_matrix_packed"])
    return model, robot, states_of(model.mechanism, np.random.default_rng(4), COUNT)[0]


@cache
def pinocchios() -> np.ndarray:
    theirs = pin.buildModelFromUrdf(path_of("solo12"), pin.JointModelFreeFlyer())
    data = theirs.createData()
    return np.array([pin.crba(theirs, data, q) for q in quadruped()[2]])


def test_a_quadrupeds_has_an_entry_for_each_pair_on_one_leg() -> None:
    """Every leg's 3 joints with each other and with the root's 6 rates, but for hips that turn about the root's x and push
    nothing along it; the root's own block is m 1, m [c]x and an inertia."""
    _, robot, q = quadruped()
    root, leg = 3 + 6 + 6, 6 + 3 * 6 - 1
    assert robot.mass_matrix_packed(q).shape == (COUNT, root + 4 * leg)


def test_as_compressed_columns_it_is_the_upper_triangle() -> None:
    """What OSQP, QDLDL and CHOLMOD read: columns are the packed rows, their lengths those of the rows."""
    _, robot, q = quadruped()
    rows, columns = robot.pattern("mass_matrix_packed")
    starts = np.searchsorted(rows, range(rows[-1] + 2))
    for values, expected in zip(robot.mass_matrix_packed(q), pinocchios(), strict=True):
        shape, scale = expected.shape, EXACT * np.abs(expected).max()
        upper = csc_matrix((values, columns, starts), shape)
        lower = csr_matrix((values, columns, starts), shape)
        assert upper.has_canonical_format
        assert np.abs(upper.toarray() - np.triu(expected)).max() <= scale
        assert np.abs(lower.toarray() - np.tril(expected)).max() <= scale


def test_the_models_own_is_the_compiled_ones() -> None:
    model, robot, q = quadruped()
    found = model.mass_matrix_packed(q)
    assert np.abs(found - robot.mass_matrix_packed(q)).max() <= EXACT * np.abs(found).max()
