"""Inverse dynamics with external wrenches and its derivative along a direction (forward mode)."""

from __future__ import annotations

from psdmc.dynamics.manifold import coordinate_rates
from psdmc.functions import inverse_dynamics_with_wrenches, inverse_dynamics_with_wrenches_derivatives
from psdmc.program.signature import TAU, Signature
from psdmc.program.slopes import slopes
from psdmc.recipes.directions import DQ, DQD, DQDD, along_direction
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.wrenches import DWRENCHES, along_all

TORQUES = inverse_dynamics_with_wrenches.RECIPE
BLOCKS = inverse_dynamics_with_wrenches_derivatives.RECIPE
DIRECTIONS = (DQ, DQD, DQDD, DWRENCHES)


def trace(g: Ingredients) -> Outputs:
    found = TORQUES.trace(g)
    by = [value for quantity in TORQUES.signature.inputs for value in g.inputs[quantity.name]]
    dq, *others = (g.inputs[direction.name] for direction in DIRECTIONS)
    tangent = [
        *coordinate_rates(g.frames, g.inputs["q"], dq),
        *(value for other in others for value in other),
    ]
    return {**found, "dtau": slopes(found["tau"], by, tangent)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    blocks = BLOCKS.reference(robot, given)
    return TORQUES.reference(robot, given) | {"dtau": along_all(blocks, DIRECTIONS, given)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    blocks = BLOCKS.pinocchio(robot, given)
    return TORQUES.pinocchio(robot, given) | {"dtau": along_all(blocks, DIRECTIONS, given)}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_with_wrenches_jvp",
        444,
        "tau under external wrenches, and its derivative along (dq, dqd, dqdd, dwrenches)",
        (*TORQUES.signature.inputs, *DIRECTIONS),
        (*TORQUES.signature.outputs, along_direction(TAU)),
        theta=True,
        summary="Compute the joint torques tau of a motion under external wrenches. Also compute dtau, the "
        "derivative of tau along a direction (dq, dqd, dqdd, dwrenches). If each input changes by e times its "
        "part of the direction, with a small number e, tau changes by about e dtau.",
    ),
    "inverse dynamics with wrenches along a direction",
    trace,
    reference,
    "rnea, computeRNEADerivatives with fext",
    pinocchio,
    shares="inverse_dynamics",
)
