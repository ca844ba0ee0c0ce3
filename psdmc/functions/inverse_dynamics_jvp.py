"""Inverse dynamics and its derivative along a direction (forward mode)."""

from __future__ import annotations

from psdmc.dynamics.manifold import coordinate_rates
from psdmc.program.signature import QD, QDD, TAU, Q, Signature
from psdmc.program.slopes import slopes
from psdmc.recipes.directions import DQ, DQD, DQDD, along, along_direction
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import torques
from psdmc.robot.mechanism import Array

DIRECTIONS = (DQ, DQD, DQDD)


def trace(g: Ingredients) -> Outputs:
    q, qd, qdd = (g.inputs[name] for name in ("q", "qd", "qdd"))
    tau = torques(g, qd, qdd, g.base_acceleration)
    dq, *others = (g.inputs[direction.name] for direction in DIRECTIONS)
    tangent = [*coordinate_rates(g.frames, q, dq), *(value for other in others for value in other)]
    return {"tau": tau, "dtau": slopes(tau, [*q, *qd, *qdd], tangent)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, qd, qdd = (given[name] for name in ("q", "qd", "qdd"))
    return {
        "tau": robot.torques(q, qd, qdd, robot.base_acceleration),
        "dtau": _along(robot.torque_derivatives(q, qd, qdd), given),
    }


def pinocchio(robot: Reference, given: Given) -> Arrays:
    states = [given[name] for name in ("q", "qd", "qdd")]
    blocks = robot.inverse_dynamics_derivatives(*states)
    return {"tau": robot.inverse_dynamics(*states), "dtau": _along(blocks, given)}


def _along(blocks: tuple[Array, ...], given: Given) -> Array:
    by_q, by_qd, by_qdd = (along(block, given[d.name]) for block, d in zip(blocks, DIRECTIONS, strict=True))
    return by_q + by_qd + by_qdd


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_jvp",
        188,
        "tau, and its derivative along (dq, dqd, dqdd)",
        (Q, QD, QDD, *DIRECTIONS),
        (TAU, along_direction(TAU)),
        theta=True,
        summary="Compute the torques tau of inverse dynamics. Also compute dtau, the derivative of tau along a "
        "direction (dq, dqd, dqdd). If the inputs change by e dq, e dqd and e dqdd, with a small number e, tau "
        "changes by about e dtau.",
    ),
    "inverse dynamics along a direction",
    trace,
    reference,
    "rnea, computeRNEADerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
)
