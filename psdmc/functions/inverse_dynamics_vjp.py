"""Inverse dynamics, and the gradient of a weighted sum of its torques (reverse mode)."""

from __future__ import annotations

from psdmc.dynamics.manifold import pulled_back
from psdmc.program.signature import QD, QDD, TAU, Q, Signature
from psdmc.program.slopes import gradients
from psdmc.recipes.directions import COTANGENT, GRADIENT_Q, GRADIENT_QD, GRADIENT_QDD, weighted
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import torques
from psdmc.robot.mechanism import Array


def trace(g: Ingredients) -> Outputs:
    q, qd, qdd = (g.inputs[name] for name in ("q", "qd", "qdd"))
    tau = torques(g, qd, qdd, g.base_acceleration)
    by_q, by_qd, by_qdd = gradients(tau, g.inputs[COTANGENT.name], (q, qd, qdd))
    return {"tau": tau, "grad_q": pulled_back(g.frames, q, by_q), "grad_qd": by_qd, "grad_qdd": by_qdd}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, qd, qdd = (given[name] for name in ("q", "qd", "qdd"))
    return _weighted(
        robot.torques(q, qd, qdd, robot.base_acceleration),
        robot.torque_derivatives(q, qd, qdd),
        given[COTANGENT.name],
    )


def pinocchio(robot: Reference, given: Given) -> Arrays:
    states = [given[name] for name in ("q", "qd", "qdd")]
    blocks = robot.inverse_dynamics_derivatives(*states)
    return _weighted(robot.inverse_dynamics(*states), blocks, given[COTANGENT.name])


def _weighted(tau: Array, blocks: tuple[Array, ...], weights: Array) -> Arrays:
    by_q, by_qd, by_qdd = (weighted(weights, block) for block in blocks)
    return {"tau": tau, "grad_q": by_q, "grad_qd": by_qd, "grad_qdd": by_qdd}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_vjp",
        180,
        "tau, and the gradient of cotangent . tau by q, qd and qdd",
        (Q, QD, QDD, COTANGENT),
        (TAU, GRADIENT_Q, GRADIENT_QD, GRADIENT_QDD),
        theta=True,
        summary="Compute the torques tau of inverse dynamics. Also compute gradients, by q, qd and qdd, of a "
        "weighted sum of tau's entries. The weighted sum is the sum of cotangent[i] * tau[i].",
    ),
    "gradient of inverse dynamics",
    trace,
    reference,
    "rnea, computeRNEADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
    benched=True,
)
