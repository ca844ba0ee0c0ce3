"""Impacts, and the gradient of weighted rates after the impact and impulses, also by theta_b."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from psdmc.dynamics.scalar import ZERO
from psdmc.functions import contact_jacobian, impulse_vjp, loop_jacobian
from psdmc.functions.impulse import BEFORE
from psdmc.program.signature import PIVOTS
from psdmc.recipes.contacts import dense_solution, held_on_arrays, joined
from psdmc.recipes.directions import (
    GRADIENT_THETA,
    along,
    parameter_gradient,
    solved,
    weighted,
    with_parameter_gradient,
)
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import rows_on_arrays
from psdmc.robot.mechanism import Array

STATE = impulse_vjp.RECIPE
"""The function without the gradient by theta_b. In M (after - before) = J^T impulses, only M depends on theta_b."""

AFTER, IMPULSES = (f"cotangent_{output.name}" for output in impulse_vjp.FUNCTION.outputs)


def trace(g: Ingredients) -> Outputs:
    values, adjoint = impulse_vjp.FUNCTION.gradient_and_adjoint(g)
    found = dict(values)
    pivots = found.pop(PIVOTS)
    change = [after - before for after, before in zip(found["qd_after"], g.inputs[BEFORE.name], strict=True)]
    # At rest, without gravity, torques are M times the change.
    kicked = replace(g, inputs={**g.inputs, "qd": g.still}, base_acceleration=ZERO, friction=None)
    by_theta = parameter_gradient(kicked, change, adjoint)
    return {**found, GRADIENT_THETA.name: [-value for value in by_theta], PIVOTS: pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    found, q = STATE.reference(robot, given), given["q"]
    free = solved(robot.mass_matrix(q), given[AFTER])

    def wanted(jacobian: Array) -> Array:
        return np.asarray(-given[IMPULSES] - along(jacobian, free))

    adjoint = free + held_on_arrays(robot, given, wanted, robot.chain.loops)[0]
    weightless = replace(robot, gravity=np.zeros((len(q), 3)))
    still = np.zeros_like(adjoint)
    rows = rows_on_arrays(weightless, q, still, found["qd_after"] - given[BEFORE.name])
    return found | {GRADIENT_THETA.name: -weighted(adjoint, rows)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return the gradient's product with theta_b in its place, from the dense system and Pinocchio's mass matrix."""
    found = STATE.pinocchio(robot, given)
    jacobian = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    if robot.loops:
        jacobian = joined(jacobian, loop_jacobian.RECIPE.pinocchio(robot, given)["J"])
    adjoint, _ = dense_solution(robot, given, jacobian, given[AFTER], -given[IMPULSES])
    kicked = along(robot.mass_matrix(given["q"]), found["qd_after"] - given[BEFORE.name])
    return found | {GRADIENT_THETA.name: -(adjoint * kicked).sum(axis=-1)}


RECIPE = with_parameter_gradient(
    STATE,
    355,
    "qd_after and impulses of an impact, and the gradient of cotangent_qd_after . qd_after + cotangent_impulses . impulses "
    "by q, qd_before and theta_b",
    "Compute the joint rates after an impact, and the impulses. Also compute gradients of a "
    "weighted sum by q, qd_before and theta_b. The weighted sum adds all cotangent_qd_after[i] * qd_after[i] and all "
    "cotangent_impulses[i] * impulses[i].",
    trace,
    reference,
    pinocchio,
)
