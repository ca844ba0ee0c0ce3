"""Gradients of forward dynamics by theta_b too, against Pinocchio with other bodies."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import (
    INTERPRETED,
    SEVERAL,
    bench,
    matches_pinocchio,
    other_bodies,
    program_matches_pinocchio,
)


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_dynamics_vjp_parameters", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("forward_dynamics_vjp_parameters", robot)


def test_the_gradient_by_theta_is_what_other_bodies_would_ask_for() -> None:
    """M d qdd = - d theta_b's torques at the same acceleration: gradient . theta_b = - (M^-1 cotangent) . those torques."""
    own = bench("sliding")
    g = own.given
    found = own.robot.forward_dynamics_vjp_parameters(g["q"], g["qd"], g["tau"], g["cotangent"])
    weights = np.linalg.solve(own.pinocchio.mass_matrix(g["q"]), g["cotangent"][..., None])[..., 0]
    for theta_b, robot in other_bodies("sliding", own.model.l + 5):
        expected = -(weights * robot.inverse_dynamics(g["q"], g["qd"], found.qdd)).sum(axis=1)
        np.testing.assert_allclose(
            found.grad_theta_b @ theta_b, expected, atol=1e-11 * np.abs(expected).max()
        )


def test_it_is_the_slope_of_forward_dynamics_along_theta() -> None:
    """Central differences in run-time parameters."""
    own = bench("sliding")
    g, step = own.given, 1e-6
    states = [g[name] for name in ("q", "qd", "tau", "cotangent")]
    theta_b = np.asarray(own.model.theta_b)
    change = theta_b * np.random.default_rng(1).uniform(-1.0, 1.0, len(theta_b))
    found = own.robot.forward_dynamics_vjp_parameters(*states, theta_b=theta_b).grad_theta_b @ change
    ahead, behind = (
        own.robot.forward_dynamics_vjp(*states, theta_b=theta_b + h * change).qdd for h in (step, -step)
    )
    expected = ((ahead - behind) * g["cotangent"]).sum(axis=1) / (2 * step)
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())
