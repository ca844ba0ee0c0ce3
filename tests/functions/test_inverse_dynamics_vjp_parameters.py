"""Gradients of inverse dynamics by theta_b too, against Pinocchio with other bodies."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import (
    ARM,
    INTERPRETED,
    SEVERAL,
    bench,
    matches_pinocchio,
    other_bodies,
    program_matches_pinocchio,
)


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("inverse_dynamics_vjp_parameters", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("inverse_dynamics_vjp_parameters", robot)


def test_the_gradient_by_theta_is_the_torques_of_every_other_body() -> None:
    """Torques are linear in theta_b: gradient . theta_b of any robot with these joints is cotangent . its torques."""
    own = bench("sliding")
    g, states = own.given, [own.given[name] for name in ("q", "qd", "qdd")]
    found = own.robot.inverse_dynamics_vjp_parameters(*states, g["cotangent"]).grad_theta_b
    for theta_b, robot in other_bodies("sliding", own.model.l + 5):
        expected = (g["cotangent"] * robot.inverse_dynamics(*states)).sum(axis=1)
        np.testing.assert_allclose(found @ theta_b, expected, atol=1e-12 * np.abs(expected).max())


def test_the_rest_is_the_gradient_without_theta() -> None:
    own = bench(ARM)
    given = [own.given[name] for name in ("q", "qd", "qdd", "cotangent")]
    whole, part = own.robot.inverse_dynamics_vjp_parameters(*given), own.robot.inverse_dynamics_vjp(*given)
    for one, other in zip(whole, part, strict=False):
        np.testing.assert_allclose(one, other, atol=1e-13 * np.abs(other).max())
