"""Forward dynamics with external wrenches and its derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from psdmc.dynamics.solve import inner_product
from psdmc.functions import (
    forward_dynamics_derivatives,
    forward_dynamics_with_wrenches,
    inverse_dynamics_with_wrenches_derivatives,
)
from psdmc.program.signature import QDD, Signature, derivative_of
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.recipes.wrenches import acceleration_derivatives, jacobians_transposed, loads, wrenches_on_links
from psdmc.reproducible import inverse, times
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

ACCELERATIONS = forward_dynamics_with_wrenches.RECIPE
TORQUES = inverse_dynamics_with_wrenches_derivatives.RECIPE
WITHOUT = forward_dynamics_derivatives.RECIPE.signature
BLOCKS = tuple(derivative_of(QDD, quantity) for quantity in ACCELERATIONS.signature.inputs)


def trace(g: Ingredients) -> Outputs:
    """Trace as `forward_dynamics_derivatives` does, with d tau_id under the wrenches. The derivative of the accelerations
    by the wrenches is M^-1 J^T."""
    jacobians = jacobians_transposed(g)
    tau = [own + load for own, load in zip(g.inputs["tau"], loads(g, jacobians), strict=True)]
    found = forward_dynamics_derivatives.traced(g, tau, wrenches_on_links(g))
    columns = [[[rows[k] for rows in frame] for k in range(6)] for frame in zip(*jacobians, strict=True)]
    by_wrenches = [
        [[inner_product(row, column) for column in frame] for frame in columns] for row in found["dqdd_dtau"]
    ]
    return {**found, "dqdd_dwrenches": by_wrenches}


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    accelerations = ACCELERATIONS.reference(robot, given)
    by_q, by_qd, by_qdd, by_wrenches = TORQUES.reference(robot, {**given, **accelerations}).values()
    by_tau = inverse(by_qdd)
    flat = by_wrenches.reshape(*by_tau.shape[:2], -1)
    last = -times(by_tau, flat).reshape(by_wrenches.shape)
    blocks = (-times(by_tau, by_q), -times(by_tau, by_qd), by_tau, last)
    return accelerations | {output.name: block for output, block in zip(BLOCKS, blocks, strict=True)}


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    found = acceleration_derivatives(robot, given)
    return {output.name: block for output, block in zip((QDD, *BLOCKS), found, strict=True)}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_with_wrenches_derivatives",
        432,
        "qdd under external wrenches, d qdd / d q, d qdd / d qd, d qdd / d tau = M(q)^-1 and d qdd / d wrenches = M(q)^-1 "
        "J^T, J along the named frames' own axes; row i: derivatives of qdd[i]",
        ACCELERATIONS.signature.inputs,
        (QDD, *BLOCKS),
        theta=True,
        summary="Compute the accelerations qdd that torques cause under external wrenches, and their derivatives by "
        "q, qd, tau and wrenches.",
        factorises=ACCELERATIONS.signature.factorises,
        products=WITHOUT.products,
    ),
    "derivatives of forward dynamics with wrenches",
    trace,
    reference,
    "computeABADerivatives with fext",
    pinocchio,
    shares="inverse_dynamics",
)
