"""Robots of example-robot-data whole, on a fixed and on a free base: models and compiled functions against extended
precision, Pinocchio and MuJoCo.

`make test` takes a few, `make test-trees` all of them, and prints the figures.
"""

from __future__ import annotations

import os
from contextlib import nullcontext

import numpy as np
import pytest
from real_trees import COUNT, ROBOTS, RealTree, error
from slow_cases import slow_but_for
from unoptimised import without_optimisation

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.mujoco_reading import NotCompared, mujoco_torques

WHOLE = os.environ.get("PSDMC_TREES") == "whole"
FEW = ("allegro_right_hand.urdf", "go2.urdf", "panda.urdf", "simple_humanoid.urdf", "tiago.urdf")
FEW_FLOATING = ("quadruped.urdf", "tiago.urdf")
COMPILED = [("panda.urdf", False), ("quadruped.urdf", False), ("quadruped.urdf", True)]
ALL_COMPILED = [(name, is_floating) for is_floating in (False, True) for name in ROBOTS]

EXACT = 1e-12
PINOCCHIOS = 1e-12
"""What Pinocchio itself may differ by from extended precision."""
SLIGHT = 1e-3
"""Share of a joint's largest torque below which its nonlinear effects and gravity torques are compared on that scale: about
a wheel's own axis they are 6e-7 N m, the rounding of its inertias."""
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
    "centroidal_momentum_matrix",
)


@pytest.fixture(
    scope="module",
    params=[(name, False) for name in (ROBOTS if WHOLE else FEW)]
    + [(name, True) for name in (ROBOTS if WHOLE else FEW_FLOATING)],
    ids=lambda case: f"{case[0]}{'-floating' if case[1] else ''}",
)
def tree(request: pytest.FixtureRequest) -> tuple[str, RealTree, DynamicsModel]:
    name, is_floating = request.param
    found = RealTree(name, is_floating)
    return name, found, derive_model(found.loaded.mechanism)


def report(name: str, **figures: float) -> None:
    print(name, *(f"{what} {figure:.1e}" for what, figure in figures.items()))


def test_joints_are_pinocchios(tree) -> None:
    name, robot, model = tree
    assert list(model.joint_names) == list(robot.oracle.names)[1:]
    assert len(model.joint_names) == ROBOTS[name] + robot.extended.is_floating


def errors(robot: RealTree, given: dict[str, np.ndarray]) -> dict[str, float]:
    """Against extended precision, within EXACT; against Pinocchio, too, but for what Pinocchio differs by from that."""
    truth, pinocchios = robot.truth, robot.pinocchios
    found: dict[str, float] = {}
    for figure, values in given.items():
        least = SLIGHT * np.abs(truth["rnea"]).max(axis=0) if figure in ("nle", "gravity") else 0.0
        own = error(pinocchios[figure], truth[figure], least)
        assert own <= PINOCCHIOS, f"Pinocchio's {figure}: {own:.1e}"
        found[figure] = error(values, truth[figure], least)
        assert error(values, pinocchios[figure], least) <= EXACT + own, figure
    return found


def test_the_model(tree) -> None:
    name, robot, model = tree
    q, qd, qdd = robot.q, robot.qd, robot.qdd
    on_arrays, given = RobotOnArrays.of(model, model.theta_b), {"q": q, "qd": qd}

    def recipe(function: str) -> np.ndarray:
        (values,) = RECIPES[function].reference(on_arrays, given).values()
        return values.reshape(COUNT, 6, -1) if function == "centroidal_momentum_matrix" else values

    found = {
        "rnea": model.inverse_dynamics(q, qd, qdd),
        "nle": model.nonlinear_effects(q, qd),
        "gravity": model.gravity(q),
        "M": model.mass_matrix(q),
        "kinetic": recipe("kinetic_energy"),
        "potential": recipe("potential_energy"),
        "cmm": recipe("centroidal_momentum_matrix"),
    }
    figures = errors(robot, found)
    regressor = {"rnea": model.regressor(q, qd, qdd) @ model.theta_b}
    figures["regressor"] = errors(robot, regressor)["rnea"]
    report(name, **figures)
    assert max(figures.values()) <= EXACT, figures


def test_base_parameters_are_as_many_as_pinocchios_rank(tree) -> None:
    name, robot, model = tree
    print(name, "l", model.l)
    assert model.l == robot.base_parameters
    if (
        robot.extended.is_floating
        and robot.oracle.nq == robot.free.nq
        and model.mechanism.parameters[:, 0].all()
    ):
        assert model.l == 10 * model.n - sum(joint.hidden for joint in model.mechanism.types)


def test_mujoco_says_the_same(tree) -> None:
    name, robot, model = tree
    try:
        mimic_map = robot.mimic_map
        free = mimic_map.positions(robot.q), mimic_map.rates(robot.qd), mimic_map.rates(robot.qdd)
        expected = mimic_map.summed(mujoco_torques(robot.loaded, *free))
    except NotCompared as reason:
        pytest.skip(str(reason))
    found = model.inverse_dynamics(robot.q, robot.qd, robot.qdd)
    beside = 1e-10 * np.abs(expected).max()  # MuJoCo works about the whole robot's centre of mass
    share = np.max(np.abs(found - expected).max(axis=0) / (np.abs(expected).max(axis=0) + beside))
    report(name, mujoco=float(share))
    assert share <= MUJOCO


@pytest.mark.parametrize(
    ("name", "is_floating"), ALL_COMPILED if WHOLE else slow_but_for(COMPILED[1:2], COMPILED, spread=True)
)
def test_compiled_functions(name: str, is_floating: bool) -> None:
    robot = RealTree(name, is_floating)
    with nullcontext() if WHOLE else without_optimisation():
        compiled = psdmc.compile(derive_model(robot.loaded.mechanism), functions=FUNCTIONS)
    q, qd, qdd = robot.q, robot.qd, robot.qdd
    found = {
        "rnea": compiled.inverse_dynamics(q, qd, qdd),
        "nle": compiled.nonlinear_effects(q, qd),
        "gravity": compiled.gravity(q),
        "M": compiled.mass_matrix(q),
        "kinetic": compiled.kinetic_energy(q, qd),
        "potential": compiled.potential_energy(q),
        "cmm": compiled.centroidal_momentum_matrix(q),
    }
    figures = errors(robot, found)
    solved = error(compiled.forward_dynamics(q, qd, robot.tau), qdd)
    report(name, **figures, fd=solved, condition=robot.condition)
    assert max(figures.values()) <= EXACT, figures
    assert solved <= SOLVED * max(1.0, robot.condition / ORDINARY)
