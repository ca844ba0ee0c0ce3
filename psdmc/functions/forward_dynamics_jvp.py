"""Forward dynamics and its derivative along a direction (forward mode)."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, TAU, Q, Signature
from psdmc.recipes.directions import DQ, DQD, DTAU, along, along_direction, solved, torque_slopes
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, accelerations


def trace(g: Ingredients) -> Outputs:
    """Compute accelerations and their derivative along a direction: d qdd = M^-1 (d tau - d tau_id). The function
    tau_id(q, qd, qdd) is inverse dynamics, at the computed acceleration."""
    qdd, factors = accelerations(g, g.inputs["tau"])
    load = [given - own for given, own in zip(g.inputs[DTAU.name], torque_slopes(g, qdd), strict=True)]
    return {"qdd": qdd, "dqdd": factors.solved(load), "pivot": factors.pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    by_q, by_qd, by_qdd = robot.torque_derivatives(given["q"], given["qd"], given["qdd"])
    load = given[DTAU.name] - along(by_q, given[DQ.name]) - along(by_qd, given[DQD.name])
    return {"qdd": given["qdd"], "dqdd": solved(by_qdd, load)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    qdd, *blocks = robot.forward_dynamics_derivatives(given["q"], given["qd"], given["tau"])
    by_q, by_qd, by_tau = (along(b, given[d.name]) for b, d in zip(blocks, (DQ, DQD, DTAU), strict=True))
    return {"qdd": qdd, "dqdd": by_q + by_qd + by_tau}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_jvp",
        190,
        "qdd, and its derivative along (dq, dqd, dtau)",
        (Q, QD, TAU, DQ, DQD, DTAU),
        (QDD, along_direction(QDD)),
        theta=True,
        summary="Compute the accelerations qdd of forward dynamics. Also compute dqdd, the derivative of qdd "
        "along a direction (dq, dqd, dtau). If the inputs change by e dq, e dqd and e dtau, with a small number "
        "e, qdd changes by about e dqdd.",
        factorises=(MASS_MATRIX,),
    ),
    "forward dynamics along a direction",
    trace,
    reference,
    "computeABADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
)
