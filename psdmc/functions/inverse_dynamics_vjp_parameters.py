"""Inverse dynamics, and the gradient of a weighted sum of its torques, also by theta_b (reverse mode)."""

from __future__ import annotations

from psdmc.functions import inverse_dynamics_vjp
from psdmc.recipes.directions import (
    COTANGENT,
    GRADIENT_THETA,
    parameter_gradient,
    weighted,
    with_parameter_gradient,
)
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import rows_on_arrays

STATE = inverse_dynamics_vjp.RECIPE
"""The function without the gradient by theta_b."""


def trace(g: Ingredients) -> Outputs:
    by_theta = parameter_gradient(g, g.inputs["qdd"], g.inputs[COTANGENT.name])
    return {**STATE.trace(g), GRADIENT_THETA.name: by_theta}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    rows = rows_on_arrays(robot, given["q"], given["qd"], given["qdd"])
    return STATE.reference(robot, given) | {GRADIENT_THETA.name: weighted(given[COTANGENT.name], rows)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return what Pinocchio computes for this function, for tests. Pinocchio has no gradient by theta_b. The result
    therefore has its product with theta_b, which is the weighted sum of the torques."""
    found = STATE.pinocchio(robot, given)
    return found | {GRADIENT_THETA.name: (given[COTANGENT.name] * found["tau"]).sum(axis=-1)}


RECIPE = with_parameter_gradient(
    STATE,
    182,
    "tau, and the gradient of cotangent . tau by q, qd, qdd and theta_b",
    "Compute the torques tau of inverse dynamics. Also compute gradients, by q, qd, qdd and theta_b, of a weighted "
    "sum of tau's entries. The weighted sum is the sum of cotangent[i] * tau[i].",
    trace,
    reference,
    pinocchio,
)
