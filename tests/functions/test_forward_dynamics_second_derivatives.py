"""Second derivatives of the weighted accelerations against CasADi's, and fifty-digit differences of the gradient; in C
against what follows from Pinocchio's derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio
from fifty_digits import fifty_digit_jacobian
from hessians_of_trees import HessianTree, error, trees, with_mimic_joints
from hypothesis import given, settings
from lowered import lowered
from random_trees import RandomTree
from wide_robots import is_pinocchios, wide_robot

from psdmc.functions import RECIPES
from psdmc.program.interpret import interpret
from psdmc.robot.coordinates import Coordinate

NAME = "forward_dynamics_second_derivatives"
EXACT = 1e-10
"""Of the largest entry."""


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio(NAME, robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


@pytest.mark.parametrize("name", ["two", pytest.param("small", marks=pytest.mark.slow)])
def test_along_tangents_it_is_pinocchios(name: str) -> None:
    is_pinocchios(NAME, name, 1e-9, in_c=name == "small")


def is_casadis(own: HessianTree) -> None:
    found = RECIPES[NAME].reference(own.arrays, own.given)["hessian"]
    assert error(found, own.expected("tau")) < EXACT


@settings(max_examples=3)
@given(trees())
def test_of_random_trees_it_is_casadis(own: HessianTree) -> None:
    is_casadis(own)


@pytest.mark.slow
@settings(max_examples=40)
@given(trees())
def test_of_many_random_trees_it_is_casadis(own: HessianTree) -> None:
    is_casadis(own)


@settings(max_examples=6)
@given(with_mimic_joints())
def test_of_trees_with_mimic_joints_it_is_casadis(own: HessianTree) -> None:
    is_casadis(own)


@pytest.mark.parametrize(
    ("parents", "mimic", "leader"),
    [
        pytest.param((-1, -1, 1), 2, 0, id="joint 1 carries joint 2, but not joint 0"),
        pytest.param((-1, 0, -1), 0, 2, id="the first joint is the mimic joint"),
    ],
)
def test_the_program_of_a_mimic_joint_on_another_branch_is_casadis(
    parents: tuple[int, ...], mimic: int, leader: int
) -> None:
    coordinates = [Coordinate(0), Coordinate(1), Coordinate(2)]
    coordinates[mimic] = Coordinate(leader, -1.5, 0.3)
    own = HessianTree(RandomTree(5, parents, "RRR"), tuple(coordinates))
    program = lowered(own.model, functions=[NAME])[NAME].single
    found = interpret(program, own.given, {"hessian": 36, "pivot": 2})["hessian"]
    assert error(found.reshape(-1, 6, 6), own.expected("tau")) < EXACT


def test_it_is_what_fifty_digit_differences_of_the_gradient_say() -> None:
    own = bench("two_link")
    gradient, kernel = (own.long_kernels[each].single for each in ("forward_dynamics_vjp", NAME))
    for k in range(3):
        point = {name: own.given[name][k] for name in ("q", "qd", "tau", "cotangent")}
        found = interpret(kernel, point, {"hessian": 36, "pivot": 2})["hessian"].reshape(6, 6)
        rows = [
            [fifty_digit_jacobian(gradient, point, f"grad_{of}", 2, by) for by in ("q", "qd", "tau")]
            for of in ("q", "qd", "tau")
        ]
        expected = np.block(rows)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_it_is_symmetric_to_the_last_bit() -> None:
    own = bench(ARM)
    found = getattr(own.robot, NAME)(*(own.given[name] for name in ("q", "qd", "tau", "cotangent")))
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))


@pytest.mark.slow
def test_calls_and_loops_take_parameters_at_run_time() -> None:
    """Of a robot with more rates than are written out: in rows, for one state, and where nothing is a number."""
    own = wide_robot("small")
    for name in (NAME, f"{NAME}_packed"):
        recipe, robot = RECIPES[name], own.compiled(name)
        states = [own.given[quantity.name] for quantity in recipe.signature.inputs]
        expected, theta_b = recipe.reference(own.arrays, own.given), np.asarray(own.model.theta_b)
        (values,) = expected.values()
        found = robot.call(recipe.signature, states, theta_b)
        assert error(found, values) < 1e-9
        one = robot.call(recipe.signature, [array[3] for array in states], theta_b)
        np.testing.assert_array_equal(one, found[3])
        assert np.isnan(robot.call(recipe.signature, states, -theta_b)).all()


def test_where_the_mass_matrix_is_not_positive_nothing_is_a_number() -> None:
    own = bench(ARM)
    states = [own.given[name][:11] for name in ("q", "qd", "tau", "cotangent")]
    for name in (NAME, f"{NAME}_packed"):
        call = getattr(own.robot, name)
        assert np.isnan(call(*states, theta_b=-np.asarray(own.model.theta_b))).all()
        assert np.isfinite(call(*states)).all()
