"""Inverse dynamics: joint torques by Newton-Euler."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, TAU, Q, Signature
from psdmc.recipes.recipe import (
    Arrays,
    Given,
    Ingredients,
    Outputs,
    Polynomials,
    Recipe,
    Reference,
    RobotOnArrays,
)
from psdmc.recipes.torques_and_accelerations import torques


def trace(g: Ingredients) -> Outputs:
    return {"tau": torques(g, g.inputs["qd"], g.inputs["qdd"], g.base_acceleration)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return {"tau": robot.torques(given["q"], given["qd"], given["qdd"], robot.base_acceleration)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"tau": robot.inverse_dynamics(given["q"], given["qd"], given["qdd"])}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics",
        10,
        "joint torques of a motion, tau = M(q) qdd + h(q, qd)",
        (Q, QD, QDD),
        (TAU,),
        theta=True,
        summary="Compute the joint torques of a motion: tau = M(q) qdd + h(q, qd). M is the mass matrix, h the sum "
        "of the Coriolis, centrifugal and gravity torques.",
    ),
    "inverse dynamics",
    trace,
    reference,
    "rnea",
    pinocchio,
    polynomials=Polynomials.TORQUE,
    in_limbs=True,
    default=True,
    benched=True,
)
