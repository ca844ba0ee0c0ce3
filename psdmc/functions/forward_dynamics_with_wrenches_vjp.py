"""Forward dynamics with external wrenches and the gradient of its weighted accelerations (reverse mode)."""

from __future__ import annotations

from psdmc.functions import forward_dynamics_with_wrenches, forward_dynamics_with_wrenches_derivatives
from psdmc.program.signature import Signature
from psdmc.recipes.directions import (
    COTANGENT,
    COTANGENT_OF_QDD,
    GRADIENT_Q,
    GRADIENT_QD,
    GRADIENT_TAU,
    torque_gradients,
    weighted,
)
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import accelerations
from psdmc.recipes.wrenches import GRADIENT_WRENCHES, WRENCHES, wrenches_on_links

ACCELERATIONS = forward_dynamics_with_wrenches.RECIPE
BLOCKS = forward_dynamics_with_wrenches_derivatives.RECIPE
GRADIENTS = (GRADIENT_Q, GRADIENT_QD, GRADIENT_TAU, GRADIENT_WRENCHES)


def trace(g: Ingredients) -> Outputs:
    """Trace as `forward_dynamics_vjp` does. The torques of inverse dynamics depend on the wrenches, too."""
    external = wrenches_on_links(g)
    qdd, factors = accelerations(g, g.inputs["tau"], external)
    weights = factors.solved(g.inputs[COTANGENT.name])
    by_q, by_qd, by_wrenches = (
        [-value for value in block]
        for block in torque_gradients(g, qdd, weights, external, g.inputs[WRENCHES.name])
    )
    blocks = zip(GRADIENTS, (by_q, by_qd, weights, by_wrenches), strict=True)
    return {"qdd": qdd, **{output.name: block for output, block in blocks}, "pivot": factors.pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return _weighted(BLOCKS.reference(robot, given), given)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return _weighted(BLOCKS.pinocchio(robot, given), given)


def _weighted(found: Arrays, given: Given) -> Arrays:
    qdd, *blocks = found.values()
    gradients = (weighted(given[COTANGENT.name], block) for block in blocks)
    return {"qdd": qdd, **{output.name: block for output, block in zip(GRADIENTS, gradients, strict=True)}}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_with_wrenches_vjp",
        434,
        "qdd under external wrenches, and the gradient of cotangent . qdd by q, qd, tau and wrenches",
        (*ACCELERATIONS.signature.inputs, COTANGENT_OF_QDD),
        (*ACCELERATIONS.signature.outputs, *GRADIENTS),
        theta=True,
        summary="Compute accelerations qdd that torques cause under external wrenches. Also compute gradients, by "
        "q, qd, tau and wrenches, of a weighted sum of qdd's entries. The weighted sum is the sum of cotangent[i] "
        "* qdd[i].",
        factorises=ACCELERATIONS.signature.factorises,
    ),
    "gradient of forward dynamics with wrenches",
    trace,
    reference,
    "computeABADerivatives with fext",
    pinocchio,
    shares="inverse_dynamics",
)
