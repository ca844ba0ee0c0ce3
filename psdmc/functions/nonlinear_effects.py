"""Nonlinear effects: the Coriolis and centrifugal torques of motion at constant joint rates, plus the gravity torques."""

from __future__ import annotations

import numpy as np

from psdmc.program.signature import QD, Q, Quantity, Signature
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
    return {"h": torques(g, g.inputs["qd"], g.still, g.base_acceleration)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return {"h": robot.torques(given["q"], given["qd"], np.zeros_like(given["qd"]), robot.base_acceleration)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"h": robot.nonlinear_effects(given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "nonlinear_effects",
        40,
        "Coriolis, centrifugal and gravity torques, h(q, qd) = C(q, qd) qd + g(q)",
        (Q, QD),
        (
            Quantity(
                "h",
                ("nv",),
                means="sum of the torques (N m), or forces (N) of sliding joints",
                unit="J",
                powers=(-1,),
            ),
        ),
        theta=True,
        weighs=True,
        summary="Compute the sum of the Coriolis, centrifugal and gravity torques: h(q, qd) = C(q, qd) qd + g(q). C "
        "is the Coriolis matrix, g the gravity torques.",
    ),
    "nonlinear effects",
    trace,
    reference,
    "nonLinearEffects",
    pinocchio,
    shares="inverse_dynamics",
    polynomials=Polynomials.BIAS,
    in_limbs=True,
    default=True,
    benched=True,
)
