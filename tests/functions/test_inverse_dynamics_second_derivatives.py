"""Second derivatives of the weighted torques against CasADi's, and fifty-digit differences of the gradient; in C against
differences of Pinocchio's derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio
from fifty_digits import fifty_digit_jacobian
from hessians_of_trees import HessianTree, error, trees, with_mimic_joints
from hypothesis import given, settings
from wide_robots import is_pinocchios

from psdmc.functions import RECIPES
from psdmc.program.interpret import interpret

NAME = "inverse_dynamics_second_derivatives"
EXACT = 1e-13
"""Of the largest entry."""


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio(NAME, robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio(NAME, robot)


@pytest.mark.parametrize("name", ["two", "small"])
def test_along_tangents_it_is_pinocchios(name: str) -> None:
    is_pinocchios(NAME, name, 1e-11, in_c=name == "small")


@settings(max_examples=12)
@given(trees())
def test_of_random_trees_it_is_casadis(own: HessianTree) -> None:
    found = RECIPES[NAME].reference(own.arrays, own.given)["hessian"]
    assert error(found, own.expected("qdd")) < EXACT


@settings(max_examples=6)
@given(with_mimic_joints())
def test_of_trees_with_mimic_joints_it_is_casadis(own: HessianTree) -> None:
    found = RECIPES[NAME].reference(own.arrays, own.given)["hessian"]
    assert error(found, own.expected("qdd")) < EXACT


def test_it_is_what_fifty_digit_differences_of_the_gradient_say() -> None:
    own = bench("two_link")
    gradient, kernel = (own.long_kernels[each].single for each in ("inverse_dynamics_vjp", NAME))
    for k in range(3):
        point = {name: own.given[name][k] for name in ("q", "qd", "qdd", "cotangent")}
        found = interpret(kernel, point, {"hessian": 36, "pivot": 2})["hessian"].reshape(6, 6)
        rows = [
            [fifty_digit_jacobian(gradient, point, f"grad_{of}", 2, by) for by in ("q", "qd", "qdd")]
            for of in ("q", "qd", "qdd")
        ]
        expected = np.block(rows)
        np.testing.assert_allclose(found, expected, atol=1e-14 * np.abs(expected).max())


def test_it_is_symmetric_to_the_last_bit() -> None:
    own = bench(ARM)
    found = getattr(own.robot, NAME)(*(own.given[name] for name in ("q", "qd", "qdd", "cotangent")))
    np.testing.assert_array_equal(found, found.transpose(0, 2, 1))
