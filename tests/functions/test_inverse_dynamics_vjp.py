"""Gradients of inverse dynamics against Pinocchio, 50-digit differences and derivatives along directions."""

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

SIZES = dict.fromkeys(("tau", "grad_q", "grad_qd", "grad_qdd"), 2)


@pytest.mark.parametrize(("robot", "real"), SEVERAL)
def test_it_is_pinocchios(robot: str, real: str) -> None:
    matches_pinocchio("inverse_dynamics_vjp", robot, real)


@pytest.mark.parametrize("robot", INTERPRETED)
def test_its_programs_are_pinocchios(robot: str) -> None:
    program_matches_pinocchio("inverse_dynamics_vjp", robot)


def test_it_is_what_fifty_digit_differences_say() -> None:
    own = bench("two_link")
    program = lower(own.model, functions=["inverse_dynamics"], theta_variants=False)[
        "inverse_dynamics"
    ].single
    kernel = own.long_kernels["inverse_dynamics_vjp"].single
    for k in range(3):
        point = {name: own.given[name][k] for name in ("q", "qd", "qdd")}
        found = interpret(kernel, point | {"cotangent": own.given["cotangent"][k]}, SIZES)
        for by in ("q", "qd", "qdd"):
            expected = own.given["cotangent"][k] @ fifty_digit_jacobian(program, point, "tau", 2, by)
            np.testing.assert_allclose(found[f"grad_{by}"], expected, atol=1e-14 * np.abs(expected).max())


@pytest.mark.parametrize("robot", ARMS)
def test_gradient_times_tangent_is_cotangent_times_slope(robot: str) -> None:
    """Reverse against forward mode."""
    own = bench(robot)
    g, states = own.given, [own.given[name] for name in ("q", "qd", "qdd")]
    back = own.robot.inverse_dynamics_vjp(*states, g["cotangent"])
    ahead = own.robot.inverse_dynamics_jvp(*states, g["dq"], g["dqd"], g["dqdd"])
    sums = (back.grad_q * g["dq"] + back.grad_qd * g["dqd"] + back.grad_qdd * g["dqdd"]).sum(axis=1)
    expected = (ahead.dtau * g["cotangent"]).sum(axis=1)
    np.testing.assert_allclose(sums, expected, atol=1e-13 * np.abs(expected).max())


def test_the_gradient_by_accelerations_is_the_mass_matrix_times_the_cotangent() -> None:
    own = bench(ARM)
    q, qd, qdd, cotangent = (own.given[name] for name in ("q", "qd", "qdd", "cotangent"))
    found = own.robot.inverse_dynamics_vjp(q, qd, qdd, cotangent).grad_qdd
    expected = np.einsum("kij,kj->ki", own.model.mass_matrix(q), cotangent)
    np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())
