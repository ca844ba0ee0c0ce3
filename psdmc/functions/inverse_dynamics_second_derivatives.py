"""Second derivatives of the weighted torques of inverse dynamics."""

from __future__ import annotations

from psdmc.dynamics.second_derivatives import inverse_dynamics_second_derivatives
from psdmc.program.signature import QD, QDD, Q, Signature
from psdmc.recipes.directions import COTANGENT, hessian_of, weighted
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import on_diagonal
from psdmc.robot.mechanism import Array


def trace(g: Ingredients) -> Outputs:
    q, qd, qdd, weights = (g.inputs[name] for name in ("q", "qd", "qdd", COTANGENT.name))
    found = inverse_dynamics_second_derivatives(
        g.frames, g.bodies, q, qd, qdd, weights, g.base_acceleration, g.choices
    )
    if g.friction is not None:
        bends = ([w * x for w, x in zip(weights, each, strict=True)] for each in g.friction.bends(q, qd))
        found = found._replace(
            by_q_q=on_diagonal(found.by_q_q, next(bends)),
            by_q_qd=on_diagonal(found.by_q_qd, next(bends)),
            by_qd_qd=on_diagonal(found.by_qd_qd, next(bends)),
        )
    return {"hessian": found.hessian}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    states = [given[name] for name in ("q", "qd", "qdd", COTANGENT.name)]
    return {"hessian": robot.torque_hessian(*states)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Differences of the gradient."""

    def gradient(*states: Array) -> list[Array]:
        return [
            weighted(given[COTANGENT.name], block) for block in robot.inverse_dynamics_derivatives(*states)
        ]

    return {"hessian": robot.second_derivatives(gradient, *(given[name] for name in ("q", "qd", "qdd")))}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_second_derivatives",
        198,
        "symmetric matrix of second derivatives of cotangent . tau by (q, qd, qdd)",
        (Q, QD, QDD, COTANGENT),
        (hessian_of(QDD, "nxa"),),
        theta=True,
        summary="Compute the second derivatives by q, qd and qdd of a weighted sum of the torques tau of inverse "
        "dynamics. The weighted sum is the sum of cotangent[i] * tau[i].",
    ),
    "second derivatives of inverse dynamics",
    trace,
    reference,
    "computeRNEADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
    beside="inverse_dynamics_derivatives",
)
