"""Derivatives of inverse dynamics by joint positions, rates and accelerations."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, Q, Signature, jacobian_of
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import torque_derivatives


def trace(g: Ingredients) -> Outputs:
    found = torque_derivatives(g, g.inputs["qdd"])
    return {"dtau_dq": found.by_q, "dtau_dqd": found.by_qd, "dtau_dqdd": found.by_qdd}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    by_q, by_qd, by_qdd = robot.torque_derivatives(given["q"], given["qd"], given["qdd"])
    return {"dtau_dq": by_q, "dtau_dqd": by_qd, "dtau_dqdd": by_qdd}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    by_q, by_qd, by_qdd = robot.inverse_dynamics_derivatives(given["q"], given["qd"], given["qdd"])
    return {"dtau_dq": by_q, "dtau_dqd": by_qd, "dtau_dqdd": by_qdd}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_derivatives",
        12,
        "d tau / d q, d tau / d qd and d tau / d qdd = M(q); row i: derivatives of tau[i]",
        (Q, QD, QDD),
        tuple(jacobian_of("tau", by) for by in ("q", "qd", "qdd")),
        theta=True,
        summary="Compute the derivatives of the torques tau of inverse dynamics by q, qd and qdd.",
    ),
    "derivatives of inverse dynamics",
    trace,
    reference,
    "computeRNEADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
    benched=True,
)
