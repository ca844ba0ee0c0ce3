"""Gravity's torques."""

from __future__ import annotations

import numpy as np

from psdmc.program.signature import Q, Quantity, Signature
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
    still = g.still
    return {"g": torques(g, still, still, g.base_acceleration)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    rest = np.zeros((len(given["q"]), robot.nv))
    return {"g": robot.torques(given["q"], rest, rest, robot.base_acceleration)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"g": robot.gravity(given["q"])}


G = Quantity(
    "g", ("nv",), means="gravity torques (N m), or forces (N) of sliding joints", unit="J", powers=(-1,)
)

RECIPE = Recipe(
    Signature(
        "gravity",
        60,
        "gravity torques g(q), which hold the robot still",
        (Q,),
        (G,),
        theta=True,
        weighs=True,
        summary="Compute the gravity torques g(q): the torques that keep the robot at rest.",
    ),
    "gravity",
    trace,
    reference,
    "computeGeneralizedGravity",
    pinocchio,
    shares="inverse_dynamics",
    polynomials=Polynomials.GRAVITY,
    default=True,
    benched=True,
)
