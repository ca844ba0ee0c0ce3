"""Velocity of the whole robot's centre of mass."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.momentum_and_energy import total_momentum
from psdmc.dynamics.scalar import Scalar, scale
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q, QD)
VELOCITY = Quantity(
    "v", ("3",), means="velocity of the centre of mass, m/s, along the axes of the base frame", unit="m/s"
)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    linear, _ = total_momentum(robot.frames, robot.solids(), q, qd)
    return {"v": scale(robot.in_base(linear), 1.0 / robot.mass)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def velocity(model: Any, data: Any, q: Array, qd: Array) -> Array:
        pin.centerOfMass(model, data, q, qd)
        return np.array(data.vcom[0])

    return {"v": robot.each(velocity, given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "com_velocity",
        410,
        "velocity of all links' common centre of mass (m/s), base frame",
        INPUTS,
        (VELOCITY,),
        theta=False,
        summary="Compute the velocity of the centre of mass of all links, along the axes of the base frame.",
    ),
    "velocity of the centre of mass",
    *on_both(values, INPUTS),
    "centerOfMass",
    pinocchio,
    needs=Needs.STANDARD,
    beside="com_jacobian",
)
