"""Derivatives of inverse dynamics with external wrenches."""

from __future__ import annotations

from typing import Any

from psdmc.functions import inverse_dynamics_with_wrenches
from psdmc.program.signature import TAU, Signature, derivative_of
from psdmc.recipes import torques_and_accelerations
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.wrenches import (
    jacobians_on_arrays,
    jacobians_transposed,
    torque_derivatives,
    wrenches_on_arrays,
    wrenches_on_links,
)

TORQUES = inverse_dynamics_with_wrenches.RECIPE.signature
OUTPUTS = tuple(derivative_of(TAU, quantity) for quantity in TORQUES.inputs)


def trace(g: Ingredients) -> Outputs:
    by_q, by_qd, by_qdd, _ = torques_and_accelerations.torque_derivatives(
        g, g.inputs["qdd"], wrenches_on_links(g)
    )
    by_wrenches = [[[-x for x in row] for row in rows] for rows in jacobians_transposed(g)]
    return _named(by_q, by_qd, by_qdd, by_wrenches)


def _named(*blocks: Any) -> dict[str, Any]:
    return {output.name: block for output, block in zip(OUTPUTS, blocks, strict=True)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    external = wrenches_on_arrays(robot, given)
    blocks = robot.torque_derivatives(given["q"], given["qd"], given["qdd"], external)
    return _named(*blocks, -jacobians_on_arrays(robot, given))


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return _named(*torque_derivatives(robot, given))


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_with_wrenches_derivatives",
        440,
        "d tau / d q, d tau / d qd, d tau / d qdd = M(q) and d tau / d wrenches = -J^T of torques under external wrenches, "
        "J along the named frames' own axes; row i: derivatives of tau[i]",
        TORQUES.inputs,
        OUTPUTS,
        theta=True,
        summary="Compute the derivatives by q, qd, qdd and wrenches of the joint torques tau of a motion under "
        "external wrenches.",
    ),
    "derivatives of inverse dynamics with wrenches",
    trace,
    reference,
    "computeRNEADerivatives with fext",
    pinocchio,
    shares="inverse_dynamics",
)
