"""Robots of example-robot-data whole: models, lowered and compiled functions against Pinocchio and MuJoCo.

`make test` takes a few, `make test-trees` all of them, and prints the figures.
"""

from __future__ import annotations

import os
from contextlib import nullcontext

import numpy as np
import pytest
from real_trees import ROBOTS, RealTree, error
from slow_cases import slow_but_for
from unoptimised import without_optimisation

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.mujoco_reading import NotCompared, mujoco_torques
from psdmc.toolchain.call import CompiledRobot

WHOLE = os.environ.get("PSDMC_TREES") == "whole"
FEW = ("allegro_right_hand.urdf", "go2.urdf", "panda.urdf", "simple_humanoid.urdf", "tiago.urdf")
COMPILED = ("panda.urdf", "quadruped.urdf")

EXACT = 1e-12
SOLVED = 1e-10
ORDINARY = 1e6
"""Condition of a mass matrix up to which forward dynamics keep to SOLVED; beyond, to that share of it."""
MUJOCO = 1e-9

FUNCTIONS = (
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "nonlinear_effects",
    "gravity",
    "kinetic_energy",
    "potential_energy",
)


@pytest.fixture(scope="module", params=ROBOTS if WHOLE else FEW)
def tree(request: pytest.FixtureRequest) -> tuple[str, RealTree, DynamicsModel]:
    found = RealTree(request.param)
    return request.param, found, derive_model(found.loaded.mechanism)


def report(name: str, **figures: float) -> None:
    print(name, *(f"{what} {figure:.1e}" for what, figure in figures.items()))


def test_joints_are_pinocchios(tree) -> None:
    name, robot, model = tree
    assert list(model.joint_names) == list(robot.oracle.names)[1:]
    assert len(model.joint_names) == ROBOTS[name]


def test_the_models_torques_and_mass_matrix(tree) -> None:
    name, robot, model = tree
    figures = torque_errors(robot, model)
    torques = model.regressor(robot.q, robot.qd, robot.qdd) @ model.theta_b
    figures["regressor"] = torque_error(robot, torques, robot.tau, robot.q, robot.qd, robot.qdd)
    report(name, **figures)
    assert max(figures.values()) <= EXACT, figures


def torque_error(robot: RealTree, found: np.ndarray, expected: np.ndarray, *states: np.ndarray) -> float:
    """Against Pinocchio; where its own rounding is more than half of EXACT, as on a wrist of a tenth of a newton
    millimetre behind an arm, against extended precision."""
    direct = error(found, expected)
    if direct <= EXACT:
        return direct
    exact = robot.exact(*states)
    assert error(expected, exact) > EXACT / 2, "Pinocchio agrees with extended precision"
    return error(found, exact)


def torque_errors(robot: RealTree, functions: DynamicsModel | CompiledRobot) -> dict[str, float]:
    q, qd, qdd = robot.q, robot.qd, robot.qdd
    rest = np.zeros_like(qd)
    return {
        "rnea": torque_error(robot, functions.inverse_dynamics(q, qd, qdd), robot.tau, q, qd, qdd),
        "M": error(functions.mass_matrix(q), robot.mass),
        "nle": torque_error(robot, functions.nonlinear_effects(q, qd), robot.bias, q, qd, rest),
        "gravity": torque_error(robot, functions.gravity(q), robot.gravity, q, rest, rest),
    }


def test_energies(tree) -> None:
    name, robot, model = tree
    on_arrays, given = RobotOnArrays.of(model, model.theta_b), {"q": robot.q, "qd": robot.qd}
    kinetic = RECIPES["kinetic_energy"].reference(on_arrays, given)
    potential = RECIPES["potential_energy"].reference(on_arrays, given)
    (T,), (V,) = kinetic.values(), potential.values()
    figures = {"kinetic": error(T, robot.kinetic), "potential": error(V, robot.potential)}
    report(name, **figures)
    assert max(figures.values()) <= EXACT, figures


def test_base_parameters_are_as_many_as_pinocchios_rank(tree) -> None:
    name, robot, model = tree
    print(name, "l", model.l)
    assert model.l == robot.base_parameters


def test_mujoco_says_the_same(tree) -> None:
    name, robot, model = tree
    try:
        following = robot.following
        free = following.positions(robot.q), following.rates(robot.qd), following.rates(robot.qdd)
        expected = following.summed(mujoco_torques(robot.loaded, *free))
    except NotCompared as reason:
        pytest.skip(str(reason))
    found = model.inverse_dynamics(robot.q, robot.qd, robot.qdd)
    beside = 1e-10 * np.abs(expected).max()  # MuJoCo works about the whole robot's centre of mass
    share = np.max(np.abs(found - expected).max(axis=0) / (np.abs(expected).max(axis=0) + beside))
    report(name, mujoco=float(share))
    assert share <= MUJOCO


@pytest.mark.parametrize("name", ROBOTS if WHOLE else slow_but_for(["quadruped.urdf"], COMPILED))
def test_compiled_functions(name: str) -> None:
    robot = RealTree(name)
    with nullcontext() if WHOLE else without_optimisation():
        compiled = psdmc.compile(derive_model(robot.loaded.mechanism), functions=FUNCTIONS)
    q, qd, qdd = robot.q, robot.qd, robot.qdd
    figures = torque_errors(robot, compiled)
    figures["kinetic"] = error(compiled.kinetic_energy(q, qd), robot.kinetic)
    figures["potential"] = error(compiled.potential_energy(q), robot.potential)
    solved = error(compiled.forward_dynamics(q, qd, robot.tau), qdd)
    report(name, **figures, fd=solved, condition=robot.condition)
    assert max(figures.values()) <= EXACT, figures
    assert solved <= SOLVED * max(1.0, robot.condition / ORDINARY)
