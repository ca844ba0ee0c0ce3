"""Forward dynamics with contacts, and the gradient of weighted accelerations and contact forces, also by theta_b."""

from __future__ import annotations

from psdmc.functions import constrained_forward_dynamics_vjp
from psdmc.program.signature import PIVOTS
from psdmc.recipes.directions import GRADIENT_THETA, parameter_gradient, weighted, with_parameter_gradient
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import rows_on_arrays

STATE = constrained_forward_dynamics_vjp.RECIPE
"""The function without the gradient by theta_b."""


def trace(g: Ingredients) -> Outputs:
    found = dict(STATE.trace(g))
    pivots = found.pop(PIVOTS)
    by_theta = parameter_gradient(g, found["qdd"], found["grad_tau"])
    return {**found, GRADIENT_THETA.name: [-value for value in by_theta], PIVOTS: pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = STATE.reference(robot, given)
    rows = rows_on_arrays(robot, given["q"], given["qd"], found["qdd"])
    return found | {GRADIENT_THETA.name: -weighted(found["grad_tau"], rows)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return the gradient's product with theta_b in its place, from Pinocchio's torques of the computed motion."""
    found = STATE.pinocchio(robot, given)
    tau = robot.inverse_dynamics(given["q"], given["qd"], found["qdd"])
    return found | {GRADIENT_THETA.name: -(found["grad_tau"] * tau).sum(axis=-1)}


RECIPE = with_parameter_gradient(
    STATE,
    345,
    "qdd and forces of constrained_forward_dynamics, and the gradient of cotangent_qdd . qdd + cotangent_forces . forces "
    "by q, qd, tau, error and theta_b",
    "Compute the accelerations qdd and contact forces that torques cause. Also compute gradients of a weighted "
    "sum by q, qd, tau, error and theta_b. The weighted sum adds all cotangent_qdd[i] * qdd[i] "
    "and all cotangent_forces[i] * forces[i]. The input `error` is the displacement of the contacts.",
    trace,
    reference,
    pinocchio,
)
