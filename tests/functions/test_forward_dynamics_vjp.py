"""Gradients of forward dynamics against Pinocchio, 50-digit differences and derivatives along directions."""

from __future__ import annotations

import numpy as np
import pytest
from against_pinocchio import (
    ARM,
    ARMS,
    INTERPRETED,
    SEVERAL,
    bench,
    matches_pinocchio,
    program_matches_pinocchio,
)
from fifty_digits import fifty_digit_jacobian

from psdmc.lower.kernels import lower
from psdmc.program.interpret import interpret

SIZES = dict.fromkeys(("qdd", "grad_q", "grad_qd", "grad_tau", "pivot"), 2)


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("forward_dynamics_vjp", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("forward_dynamics_vjp", robot)


def test_it_is_what_fifty_digit_differences_say() -> None:
    own = bench("two_link")
    program = lower(own.model, functions=["forward_dynamics"], theta_variants=False)[
        "forward_dynamics"
    ].single
    kernel = own.long_kernels["forward_dynamics_vjp"].single
    for k in range(3):
        point = {name: own.given[name][k] for name in ("q", "qd", "tau")}
        found = interpret(kernel, point | {"cotangent": own.given["cotangent"][k]}, SIZES)
        for by in ("q", "qd", "tau"):
            expected = own.given["cotangent"][k] @ fifty_digit_jacobian(program, point, "qdd", 2, by)
            np.testing.assert_allclose(found[f"grad_{by}"], expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("robot", ARMS)
def test_gradient_times_tangent_is_cotangent_times_slope(robot: str) -> None:
    """Reverse against forward mode."""
    own = bench(robot)
    g, states = own.given, [own.given[name] for name in ("q", "qd", "tau")]
    back = own.robot.forward_dynamics_vjp(*states, g["cotangent"])
    ahead = own.robot.forward_dynamics_jvp(*states, g["dq"], g["dqd"], g["dtau"])
    sums = (back.grad_q * g["dq"] + back.grad_qd * g["dqd"] + back.grad_tau * g["dtau"]).sum(axis=1)
    expected = (ahead.dqdd * g["cotangent"]).sum(axis=1)
    np.testing.assert_allclose(sums, expected, atol=1e-12 * np.abs(expected).max())


def test_where_the_mass_matrix_is_not_positive_nothing_is_a_number() -> None:
    own = bench(ARM)
    g, count = own.given, 11
    states = [g[name][:count] for name in ("q", "qd", "tau", "cotangent")]
    for output in own.robot.forward_dynamics_vjp(*states, theta_b=-np.asarray(own.model.theta_b)):
        assert np.isnan(output).all()
    for output in own.robot.forward_dynamics_vjp(*states):
        assert np.isfinite(output).all()
