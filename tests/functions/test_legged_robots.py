"""The functions that optimisers of legged robots call: PROGRAMs and C of arms, of a quadruped, and of trees with sliding and
mimic joints."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from bundled import robot_path
from lowered import lowered
from mimic_trees import as_urdf
from pinocchio_robots import path_of
from random_trees import TREES, RandomTree
from slow_cases import slow_but_for
from unoptimised import without_optimisation

import psdmc
from psdmc.derivation.derive import derive_model
from psdmc.functions import RECIPES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import on_joints
from psdmc.program.interpret import interpret
from psdmc.program.signature import Sizes
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.load import load_robot, load_robot_text
from psdmc.robot.reference import OnCoordinates, Reference, reference
from psdmc.verification.functions import function_errors

KINEMATIC = (
    "frame_jacobian_local",
    "frame_acceleration",
    "frame_acceleration_derivatives",
    "com_velocity",
    "com_velocity_derivatives",
    "com_acceleration",
    "com_acceleration_derivatives",
    "centroidal_momentum",
    "centroidal_momentum_derivatives",
    "centroidal_momentum_rate",
    "centroidal_momentum_rate_derivatives",
)
WRENCHES = (
    "forward_dynamics_with_wrenches",
    "forward_dynamics_with_wrenches_derivatives",
    "forward_dynamics_with_wrenches_vjp",
    "forward_dynamics_with_wrenches_jvp",
    "inverse_dynamics_with_wrenches_derivatives",
    "inverse_dynamics_with_wrenches_vjp",
    "inverse_dynamics_with_wrenches_jvp",
)
FRAMES = {"hyq": ["lf_foot", "rf_foot", "lh_foot", "rh_foot"], "panda": ["panda_link7", "panda_link4"]}
ROBOTS = ("kr6", "panda", "hyq")
COUNT, EXACT = 20, 1e-10
MIMICS = {"sliding": ("RPRRPRPR", 3, 4), "turning": ("RRPRRRRP", 1, 5)}
"""Types of the joints of a tree, and the numbers of a joint and of the one that follows it."""


@cache
def robot(name: str) -> tuple[DynamicsModel, Reference]:
    if name == "kr6":
        loaded = load_robot(robot_path(name))
    else:
        tip = "panda_link7" if name == "panda" else None
        loaded = load_robot(path_of(name), tip=tip, floating=name == "hyq", frames=FRAMES[name])
    return derive_model(loaded.mechanism, expand=False), reference(loaded)


@cache
def mimic_tree(name: str) -> tuple[DynamicsModel, OnCoordinates]:
    kinds, leader, own = MIMICS[name]
    tree = RandomTree(31, TREES["interleaved"], kinds)
    coordinates = [Coordinate(i) for i in range(tree.n)]
    coordinates[own] = Coordinate(leader, -0.8, 0.02)
    loaded = load_robot_text(as_urdf(tree, coordinates), "urdf", frames=["link5", "link7"])
    model = derive_model(loaded.mechanism, expand=False)
    return model, OnCoordinates.of(reference(loaded), model.mechanism)


def drawn(model: DynamicsModel) -> dict[str, np.ndarray]:
    """Every quantity that the functions read."""
    rng, sizes = np.random.default_rng(9), Sizes.of(model.mechanism, model.l)
    read = {q.name: q for name in (*KINEMATIC, *WRENCHES) for q in RECIPES[name].signature.inputs}
    given = {q.name: q.drawn(rng.uniform(-1.0, 1.0, (COUNT, *sizes.shape(q.axes)))) for q in read.values()}
    return given | {"q": on_joints(model.mechanism, given["q"])}


def computed(model: DynamicsModel, function: str, given: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """By the function's PROGRAM for one state."""
    signature, sizes = RECIPES[function].signature, Sizes.of(model.mechanism, model.l)
    flat = {q.name: given[q.name].reshape(COUNT, -1) for q in signature.inputs}
    program = lowered(model, functions=[function])[function].single
    found = interpret(program, flat, signature.sizes(sizes))
    return {q.name: found[q.name].reshape(COUNT, *sizes.shape(q.axes)) for q in signature.outputs}


QUICK = [("hyq", "frame_acceleration_derivatives"), ("hyq", "centroidal_momentum_rate_derivatives")]
QUICK += [("kr6", "inverse_dynamics_with_wrenches_derivatives")]
CASES = [(name, function) for name in ROBOTS for function in (*KINEMATIC, *WRENCHES)]


@pytest.mark.parametrize(("name", "function"), slow_but_for(QUICK, CASES, spread=True))
def test_programs_of_known_robots_are_pinocchios(name: str, function: str) -> None:
    model, theirs = robot(name)
    given = drawn(model)
    given["tau"] = theirs.inverse_dynamics(given["q"], given["qd"], given["qdd"])
    expected = RECIPES[function].pinocchio(theirs, given)
    for output, values in computed(model, function, given).items():
        assert np.abs(values - expected[output]).max() <= EXACT * np.abs(expected[output]).max(), output


@pytest.mark.parametrize("name", list(MIMICS))
def test_of_mimic_joints_the_values_are_pinocchios(name: str) -> None:
    """The NumPy side; accelerations, which Pinocchio does not solve for here, follow below from torques."""
    model, theirs = mimic_tree(name)
    errors = {
        recipe.name: error
        for recipe, error, *_ in function_errors(model, model.theta_b, theirs, condition=1.0)
    }
    for function in (*KINEMATIC, *WRENCHES[4:]):
        assert errors[function] < EXACT, function


@pytest.mark.parametrize(
    ("name", "function"),
    slow_but_for(
        [("sliding", "centroidal_momentum_rate_derivatives"), ("turning", "frame_acceleration_derivatives")],
        [(name, function) for name in MIMICS for function in (*KINEMATIC, *WRENCHES)],
        spread=True,
    ),
)
def test_programs_of_mimic_joints_are_the_numpy_sides(name: str, function: str) -> None:
    model, _ = mimic_tree(name)
    arrays, given = RobotOnArrays.of(model, model.theta_b), drawn(model)
    given["tau"] = arrays.torques(given["q"], given["qd"], given["qdd"], arrays.base_acceleration)
    expected = RECIPES[function].reference(arrays, given)
    for output, values in computed(model, function, given).items():
        assert np.abs(values - expected[output]).max() <= EXACT * np.abs(expected[output]).max(), output


def test_accelerations_of_mimic_joints_follow_from_torques() -> None:
    """d qdd = -M^-1 d tau at the same accelerations; the torques' derivatives are Pinocchio's."""
    model, _ = mimic_tree("sliding")
    given = drawn(model)
    given["tau"] = computed_torques(model, given)
    found = computed(model, "forward_dynamics_with_wrenches_derivatives", given)
    np.testing.assert_allclose(found["qdd"], given["qdd"], atol=1e-9 * np.abs(given["qdd"]).max())
    blocks = computed(model, "inverse_dynamics_with_wrenches_derivatives", given)
    for by in ("q", "qd", "wrenches"):
        moved = np.einsum("kij,kj...->ki...", blocks["dtau_dqdd"], found[f"dqdd_d{by}"])
        expected = -blocks[f"dtau_d{by}"]
        np.testing.assert_allclose(moved, expected, atol=1e-9 * np.abs(expected).max())


def computed_torques(model: DynamicsModel, given: dict[str, np.ndarray]) -> np.ndarray:
    return computed(model, "inverse_dynamics_with_wrenches", given)["tau"]


@pytest.mark.slow
@pytest.mark.parametrize("real", ["float64", "float32"])
def test_a_quadrupeds_c_is_pinocchios(real: str) -> None:
    model, theirs = robot("hyq")
    functions = [*KINEMATIC, "inverse_dynamics_with_wrenches_derivatives", "forward_dynamics_with_wrenches"]
    with without_optimisation():
        compiled = psdmc.compile(model, functions=functions, real=real)
    given = {name: values.astype(real).astype(float) for name, values in drawn(model).items()}
    given["q"] = on_joints(model.mechanism, given["q"])
    given["tau"] = theirs.inverse_dynamics(given["q"], given["qd"], given["qdd"])
    exact = EXACT if real == "float64" else 1e-3
    for function in functions:
        signature = RECIPES[function].signature
        expected = RECIPES[function].pinocchio(theirs, given)
        found = compiled.call(signature, [given[q.name] for q in signature.inputs])
        parts = [found] if len(signature.outputs) == 1 else found
        for values, output in zip(parts, expected.values(), strict=True):
            assert np.abs(values - output).max() <= exact * np.abs(output).max(), function
