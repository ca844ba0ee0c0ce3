"""What packages' self-tests compare with: Pinocchio's values, other parameters included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bundled import bundled_model, bundled_robot

from psdmc.backends.reference_states import COUNT, SHARE, ReferenceStates, reference_states
from psdmc.functions import DEFAULT, SIGNATURES
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.random_states import random_parameters
from psdmc.robot.reference import Reference, reference

ROBOTS = ("two_link", "scara", "kr6")
STRICT = 1e-12


def _error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected.reshape(found.shape)).max() / np.abs(expected).max())


def _others(model: DynamicsModel) -> tuple[np.ndarray, np.ndarray]:
    """Standard parameters of the run-time theta_b: the robot's and a share of others."""
    x = model.chain.parameters.ravel() + SHARE * random_parameters(model.chain)
    return x.reshape(model.n, -1), model.B @ x


def _compare(states: ReferenceStates, suffix: str, theta: np.ndarray, robot: Reference) -> None:
    q, qd, qdd, qd_r, qdd_r = (states.given[name] for name in ("q", "qd", "qdd", "qd_r", "qdd_r"))
    n = q.shape[1]
    coriolis, mass, gravity = robot.coriolis_matrix(q, qd), robot.mass_matrix(q), robot.gravity(q)
    tau = robot.inverse_dynamics(q, qd, qdd)
    expected = {
        "inverse_dynamics": tau,
        "mass_matrix": mass,
        "nonlinear_effects": robot.nonlinear_effects(q, qd),
        "coriolis_matrix": coriolis,
        "gravity": gravity,
    }
    for name, values in expected.items():
        assert _error(states.expected[f"{name}{suffix}"], values) < STRICT, name
    assert _error(states.given[f"tau{suffix}"], tau) < STRICT
    forward = robot.forward_dynamics(q, qd, states.given[f"tau{suffix}"])
    assert _error(states.expected[f"forward_dynamics{suffix}"], forward) < 1e-9
    slotine_li = np.einsum("sij,sj->si", mass, qdd_r) + np.einsum("sij,sj->si", coriolis, qd_r) + gravity
    for name, torques in (("regressor", tau), ("regressor_slotine_li", slotine_li)):
        assert _error(states.expected[name].reshape(len(q), n, -1) @ theta, torques) < STRICT, name
    assert _error(states.expected["jacobian"], robot.jacobian(q)) < STRICT


@pytest.mark.parametrize("name", ROBOTS)
def test_every_value_is_pinocchios(name: str) -> None:
    model, loaded = bundled_model(name), bundled_robot(name)
    states = reference_states(model)
    _compare(states, "", np.asarray(model.theta_b), reference(loaded))
    parameters, theta = _others(model)
    np.testing.assert_allclose(states.theta_b, theta, rtol=1e-9, atol=1e-12)
    _compare(states, "_theta", states.theta_b, reference(loaded, parameters=parameters))


def test_unknown_parameters_leave_what_does_not_need_them() -> None:
    model = replace(bundled_model("scara"), theta_b=None)
    states = reference_states(model)
    with_theta = {f"{name}_theta" for name in DEFAULT if SIGNATURES[name].theta}
    assert set(states.expected) == with_theta | {"regressor", "regressor_slotine_li", "jacobian"}
    assert len(states.given["q"]) == COUNT


def test_run_time_parameters_are_not_the_robots_own() -> None:
    states = reference_states(bundled_model("kr6"))
    own, other = states.expected["gravity"], states.expected["gravity_theta"]
    assert _error(other, own) > 1e-2


def test_an_indefinite_mass_matrix_leaves_forward_dynamics_out() -> None:
    model = bundled_model("two_link")
    states = reference_states(replace(model, theta_b=-np.asarray(model.theta_b)))
    assert "forward_dynamics" not in states.expected
    assert "inverse_dynamics" in states.expected
