"""The Jacobians of a step of fourth-order Runge-Kutta against Pinocchio's derivatives chained in NumPy, and against
differences of rk4_step at fifty digits."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import ARM, INTERPRETED, SEVERAL, bench, matches_pinocchio, program_matches_pinocchio
from bundled import bundled_model
from fifty_digits import fifty_digit_jacobian
from unoptimised import without_optimisation

from psdmc.compiler import compile
from psdmc.lower.admitted import wanted
from psdmc.lower.kernels import lower


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_they_are_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("rk4_step_derivatives", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_their_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("rk4_step_derivatives", robot)


def test_they_are_the_slopes_of_the_step_at_fifty_digits() -> None:
    """In C, of two joints; a long step, so that all four stages count."""
    model = bundled_model("two_link")
    step = lower(model, "factored", ["rk4_step"], theta_variants=False)["rk4_step"].single
    rng = np.random.default_rng(5)
    point = {name: rng.uniform(-2.0, 2.0, 2) for name in ("q", "qd", "tau")} | {"dt": np.array([0.2])}
    with without_optimisation():
        robot = compile(model, functions=["rk4_step_derivatives"])
    found = robot.rk4_step_derivatives(*(point[name] for name in ("q", "qd", "tau")), 0.2)
    blocks = [
        [fifty_digit_jacobian(step, point, of, 2, by) for by in ("q", "qd", "tau")]
        for of in ("q_next", "qd_next")
    ]
    truth = np.block(blocks)
    np.testing.assert_allclose(np.hstack([found.A, found.B]), truth, atol=1e-13 * np.abs(truth).max())


def test_it_is_rk4_steps_state() -> None:
    own = bench(ARM)
    states = [own.given[name][:9] for name in ("q", "qd", "tau")]
    found, step = own.robot.rk4_step_derivatives(*states, 0.01), own.robot.rk4_step(*states, 0.01)
    np.testing.assert_allclose(found.q_next, step.q_next, rtol=1e-12)
    np.testing.assert_allclose(found.qd_next, step.qd_next, rtol=1e-11)


def test_a_stage_without_a_positive_mass_matrix_spoils_the_step() -> None:
    own = bench(ARM)
    states = [own.given[name][:9] for name in ("q", "qd", "tau")]
    for output in own.robot.rk4_step_derivatives(*states, 0.01, theta_b=-np.asarray(own.model.theta_b)):
        assert np.isnan(output).all()


def test_what_it_calls_comes_along() -> None:
    assert wanted(["rk4_step_derivatives"]) == ("forward_dynamics_derivatives", "rk4_step_derivatives")
