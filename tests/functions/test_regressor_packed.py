"""The packed regressor: torques by Pinocchio, and least squares as an estimator makes them of it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import ROBOTS, bench, other_bodies
from pinocchio_robots import path_of
from scipy.sparse import csr_matrix
from unoptimised import without_optimisation

import psdmc
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import states_of
from psdmc.recipes.recipe import unpacked
from psdmc.toolchain.call import CompiledRobot

COUNT = 9
EXACT = 1e-12


def assert_near(found: np.ndarray, expected: np.ndarray, limit: float = EXACT) -> None:
    assert np.abs(found - expected).max() <= limit * np.abs(expected).max()


def dense(robot: CompiledRobot, values: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    rows, columns = robot.pattern("regressor_packed")
    found = np.zeros((len(values), *shape))
    found[:, rows, columns] = values
    return found


@pytest.mark.parametrize("name", ROBOTS)
def test_times_theta_b_it_is_pinocchios_torques(name: str) -> None:
    own = bench(name)
    states = (own.given["q"], own.given["qd"], own.given["qdd"])
    found = dense(own.robot, own.robot.regressor_packed(*states), (own.model.n, own.model.l))
    assert_near(found @ own.model.theta_b, own.pinocchio.inverse_dynamics(*states))


def test_also_those_of_other_bodies_on_the_same_joints() -> None:
    own = bench("sliding")
    states = (own.given["q"], own.given["qd"], own.given["qdd"])
    found = dense(own.robot, own.robot.regressor_packed(*states), (own.model.n, own.model.l))
    for theta_b, other in other_bodies("sliding", 5):
        assert_near(found @ theta_b, other.inverse_dynamics(*states))


def test_the_reference_is_the_dense_ones_entries() -> None:
    own, recipe = bench("sliding"), RECIPES["regressor_packed"]
    assert recipe.packs is not None
    values = recipe.reference(own.arrays, own.given)["values"]
    whole = unpacked(recipe.packs, RECIPES["regressor"], own.arrays, values)
    expected = RECIPES["regressor"].reference(own.arrays, own.given)
    assert_near(whole["Y"], expected["Y"], 1e-14)


@cache
def quadruped() -> tuple[DynamicsModel, CompiledRobot]:
    model = psdmc.derive(path_of("solo12"), floating=True)
    with without_optimisation():
        return model, psdmc.compile(model, functions=["regressor_packed"])


def test_a_quadrupeds_rows_times_theta_b_are_pinocchios_torques() -> None:
    model, robot = quadruped()
    theirs = pin.buildModelFromUrdf(path_of("solo12"), pin.JointModelFreeFlyer())
    data = theirs.createData()
    q, qd, qdd = states_of(model.mechanism, np.random.default_rng(5), COUNT)
    rows, columns = robot.pattern("regressor_packed")
    starts = np.searchsorted(rows, range(model.nv + 1))
    for state, values in zip(zip(q, qd, qdd, strict=True), robot.regressor_packed(q, qd, qdd), strict=True):
        Y = csr_matrix((values, columns, starts), (model.nv, model.l))
        assert_near(Y @ model.theta_b, pin.rnea(theirs, data, *state))
    assert len(rows) < 0.4 * model.nv * model.l


def test_the_interface_without_its_matrix_knows_its_length() -> None:
    model, robot = quadruped()
    q, qd, qdd = (np.zeros(size) for size in (model.nq, model.nv, model.nv))
    q[6] = 1.0
    out = np.empty(len(robot.pattern("regressor_packed")[0]))
    assert robot.regressor_packed(q, qd, qdd, out=out) is out
    assert model.regressor_packed(q, qd, qdd).shape == out.shape
