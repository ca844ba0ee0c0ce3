"""Forward dynamics, and the gradient of a weighted sum of its accelerations, also by theta_b (reverse mode)."""

from __future__ import annotations

from psdmc.functions import forward_dynamics_vjp
from psdmc.recipes.directions import GRADIENT_THETA, parameter_gradient, weighted, with_parameter_gradient
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import rows_on_arrays

STATE = forward_dynamics_vjp.RECIPE
"""The function without the gradient by theta_b."""


def trace(g: Ingredients) -> Outputs:
    found = dict(STATE.trace(g))
    pivots = found.pop("pivot")
    by_theta = parameter_gradient(g, found["qdd"], found["grad_tau"])
    return {**found, GRADIENT_THETA.name: [-value for value in by_theta], "pivot": pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found = STATE.reference(robot, given)
    rows = rows_on_arrays(robot, given["q"], given["qd"], given["qdd"])
    return found | {GRADIENT_THETA.name: -weighted(found["grad_tau"], rows)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return what Pinocchio computes for this function, for tests. Pinocchio has no gradient by theta_b. The result
    therefore has its product with theta_b, which is -(grad_tau . tau)."""
    found = STATE.pinocchio(robot, given)
    return found | {GRADIENT_THETA.name: -(found["grad_tau"] * given["tau"]).sum(axis=-1)}


RECIPE = with_parameter_gradient(
    STATE,
    186,
    "qdd, and the gradient of cotangent . qdd by q, qd, tau and theta_b",
    "Compute the accelerations qdd of forward dynamics. Also compute gradients, by q, qd, tau and theta_b, of a "
    "weighted sum of qdd's entries. The weighted sum is the sum of cotangent[i] * qdd[i].",
    trace,
    reference,
    pinocchio,
)
