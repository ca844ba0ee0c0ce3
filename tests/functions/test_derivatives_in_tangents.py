"""Derivatives of robots whose q is no vector, along its tangent, against Pinocchio's."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from against_pinocchio import WHOLE
from pinocchio_robots import path_of
from slow_cases import slow_but_for
from unoptimised import without_optimisation
from wide_robots import KINDS, is_pinocchios, wide_robot

import psdmc
from psdmc.functions import RECIPES
from psdmc.model.random_states import states_of
from psdmc.robot.reference import Reference

EXACT, SOLVED = 1e-11, 1e-9
"""Of each block's largest entry; SOLVED where the mass matrix, of condition 1e5, is inverted."""

TORQUES = ("inverse_dynamics_derivatives", "gravity_derivatives")
ALONG = ("inverse_dynamics_vjp", "inverse_dynamics_jvp", "inverse_dynamics_vjp_parameters")
ACCELERATIONS = ("forward_dynamics_derivatives", "forward_dynamics_vjp", "forward_dynamics_jvp")


@pytest.mark.parametrize("name", KINDS)
def test_the_recursion_is_pinocchios(name: str) -> None:
    own = wide_robot(name)
    for function in (*TORQUES, *ACCELERATIONS):
        recipe = RECIPES[function]
        expected, found = recipe.pinocchio(own.pinocchio, own.given), recipe.reference(own.arrays, own.given)
        for block, values in expected.items():
            limit = SOLVED if function in ACCELERATIONS else EXACT
            assert np.abs(found[block] - values).max() <= limit * np.abs(values).max(), (function, block)


@pytest.mark.parametrize("name", ["small", *(["hand"] if WHOLE else [])])
@pytest.mark.parametrize("function", [*TORQUES, "inverse_dynamics_jvp"])
def test_torques_derivatives_are_pinocchios(function: str, name: str) -> None:
    is_pinocchios(function, name, EXACT, in_c=name == "small")


@pytest.mark.parametrize("function", slow_but_for(["forward_dynamics_derivatives"], ACCELERATIONS))
def test_accelerations_derivatives_are_pinocchios(function: str) -> None:
    is_pinocchios(function, "small", SOLVED, in_c=function == "forward_dynamics_derivatives")


def test_gradients_are_pinocchios() -> None:
    is_pinocchios("inverse_dynamics_vjp", "small", EXACT)


def test_columns_are_difference_quotients_along_integrate() -> None:
    """Neither psdmc's recursion nor Pinocchio's: torques beside q, where `integrate` comes to."""
    own = wide_robot("free")
    robot = own.compiled("integrate", "difference")
    q, qd, qdd = (own.given[name] for name in ("q", "qd", "qdd"))
    by_q, _, _ = own.arrays.torque_derivatives(q, qd, qdd)
    for k in range(own.model.nv):
        step = 1e-6 * np.eye(own.model.nv)[k]
        ahead, behind = (
            own.model.inverse_dynamics(robot.integrate(q, sign * step), qd, qdd) for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(by_q[:, :, k], (ahead - behind) / 2e-6, atol=1e-7 * np.abs(by_q).max())


@pytest.mark.skipif(not WHOLE, reason="make test-accuracy takes it")
def test_a_quadrupeds_in_c_one_state_after_the_other() -> None:
    """Products with M^-1 in loops, and no code for lanes: as lines they would take gcc minutes."""
    path = path_of("solo12")
    model = psdmc.derive(path, floating=True)
    oracle = Reference(pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer()), "FL_FOOT")
    with without_optimisation():
        robot = psdmc.compile(model, functions=["forward_dynamics_derivatives"])
    assert "MINUS_PRODUCT" in (robot.library.parent / "src/forward_dynamics_derivatives.inc").read_text(
        "utf-8"
    )
    q, qd, qdd = states_of(model.mechanism, np.random.default_rng(2), 11)
    tau = oracle.inverse_dynamics(q, qd, qdd)
    expected = oracle.forward_dynamics_derivatives(q, qd, tau)
    for theta_b in (None, model.theta_b):
        found = robot.forward_dynamics_derivatives(q, qd, tau, theta_b)
        for block, values in zip(found, expected, strict=True):
            assert np.abs(block - values).max() <= SOLVED * np.abs(values).max()
