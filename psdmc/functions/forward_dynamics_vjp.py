"""Forward dynamics, and the gradient of a weighted sum of its accelerations (reverse mode)."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, TAU, Q, Signature
from psdmc.recipes.directions import (
    COTANGENT,
    COTANGENT_OF_QDD,
    GRADIENT_Q,
    GRADIENT_QD,
    GRADIENT_TAU,
    solved,
    torque_gradients,
    weighted,
)
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, accelerations


def trace(g: Ingredients) -> Outputs:
    """Compute accelerations, and the gradients of the weighted sum cotangent . qdd by q, qd and tau.

    The accelerations change by d qdd = M^-1 (d tau - d tau_id). The function tau_id(q, qd, qdd) is inverse dynamics, at
    the computed acceleration. Let w be the solution of M w = cotangent. The gradients of cotangent . qdd are then the
    gradients of w . (tau - tau_id).
    """
    qdd, factors = accelerations(g, g.inputs["tau"])
    weights = factors.solved(g.inputs[COTANGENT.name])
    by_q, by_qd, _ = torque_gradients(g, qdd, weights)
    return {
        "qdd": qdd,
        "grad_q": [-value for value in by_q],
        "grad_qd": [-value for value in by_qd],
        "grad_tau": weights,
        "pivot": factors.pivots,
    }


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    by_q, by_qd, by_qdd = robot.torque_derivatives(given["q"], given["qd"], given["qdd"])
    weights = solved(by_qdd, given[COTANGENT.name])
    return {
        "qdd": given["qdd"],
        "grad_q": -weighted(weights, by_q),
        "grad_qd": -weighted(weights, by_qd),
        "grad_tau": weights,
    }


def pinocchio(robot: Reference, given: Given) -> Arrays:
    qdd, *blocks = robot.forward_dynamics_derivatives(given["q"], given["qd"], given["tau"])
    by_q, by_qd, by_tau = (weighted(given[COTANGENT.name], block) for block in blocks)
    return {"qdd": qdd, "grad_q": by_q, "grad_qd": by_qd, "grad_tau": by_tau}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_vjp",
        184,
        "qdd, and the gradient of cotangent . qdd by q, qd and tau",
        (Q, QD, TAU, COTANGENT_OF_QDD),
        (QDD, GRADIENT_Q, GRADIENT_QD, GRADIENT_TAU),
        theta=True,
        summary="Compute the accelerations qdd of forward dynamics. Also compute gradients, by q, qd and tau, of a "
        "weighted sum of qdd's entries. The weighted sum is the sum of cotangent[i] * qdd[i].",
        factorises=(MASS_MATRIX,),
    ),
    "gradient of forward dynamics",
    trace,
    reference,
    "computeABADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
    benched=True,
)
