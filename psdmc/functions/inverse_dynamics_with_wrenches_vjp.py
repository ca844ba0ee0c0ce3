"""Inverse dynamics with external wrenches and the gradient of its weighted torques (reverse mode)."""

from __future__ import annotations

from psdmc.dynamics.manifold import pulled_back
from psdmc.functions import inverse_dynamics_with_wrenches, inverse_dynamics_with_wrenches_derivatives
from psdmc.program.signature import Signature
from psdmc.program.slopes import gradients
from psdmc.recipes.directions import COTANGENT, GRADIENT_Q, GRADIENT_QD, GRADIENT_QDD, weighted
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.wrenches import GRADIENT_WRENCHES

TORQUES = inverse_dynamics_with_wrenches.RECIPE
BLOCKS = inverse_dynamics_with_wrenches_derivatives.RECIPE
GRADIENTS = (GRADIENT_Q, GRADIENT_QD, GRADIENT_QDD, GRADIENT_WRENCHES)


def trace(g: Ingredients) -> Outputs:
    found, inputs = TORQUES.trace(g), [g.inputs[quantity.name] for quantity in TORQUES.signature.inputs]
    by_q, *others = gradients(found["tau"], g.inputs[COTANGENT.name], inputs)
    blocks = (pulled_back(g.frames, inputs[0], by_q), *others)
    return {**found, **{output.name: block for output, block in zip(GRADIENTS, blocks, strict=True)}}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return TORQUES.reference(robot, given) | _weighted(BLOCKS.reference(robot, given), given)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return TORQUES.pinocchio(robot, given) | _weighted(BLOCKS.pinocchio(robot, given), given)


def _weighted(blocks: Arrays, given: Given) -> Arrays:
    found = zip(GRADIENTS, blocks.values(), strict=True)
    return {output.name: weighted(given[COTANGENT.name], block) for output, block in found}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_with_wrenches_vjp",
        442,
        "tau under external wrenches, and the gradient of cotangent . tau by q, qd, qdd and wrenches",
        (*TORQUES.signature.inputs, COTANGENT),
        (*TORQUES.signature.outputs, *GRADIENTS),
        theta=True,
        summary="Compute torques tau of a motion under external wrenches. Also compute gradients, by q, qd, qdd "
        "and wrenches, of a weighted sum of tau's entries. The weighted sum is the sum of cotangent[i] * tau[i].",
    ),
    "gradient of inverse dynamics with wrenches",
    trace,
    reference,
    "rnea, computeRNEADerivatives with fext",
    pinocchio,
    shares="inverse_dynamics",
)
