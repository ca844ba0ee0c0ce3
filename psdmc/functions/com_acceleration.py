"""Acceleration of the whole robot's centre of mass."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.momentum_and_energy import total_momentum_rate
from psdmc.dynamics.scalar import Scalar, scale
from psdmc.program.signature import QD, QDD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q, QD, QDD)
ACCELERATION = Quantity(
    "a",
    ("3",),
    means="acceleration of the centre of mass, m/s^2, along the axes of the base frame; gravity is not added",
    unit="m/s^2",
)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar], qdd: list[Scalar]) -> Outputs:
    force, _ = total_momentum_rate(robot.frames, robot.solids(), q, qd, qdd)
    return {"a": scale(robot.in_base(force), 1.0 / robot.mass)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def acceleration(model: Any, data: Any, q: Array, qd: Array, qdd: Array) -> Array:
        pin.centerOfMass(model, data, q, qd, qdd)
        return np.array(data.acom[0])

    return {"a": robot.each(acceleration, given["q"], given["qd"], given["qdd"])}


RECIPE = Recipe(
    Signature(
        "com_acceleration",
        414,
        "acceleration of all links' common centre of mass (m/s^2), J qdd + dJ/dt qd, base frame",
        INPUTS,
        (ACCELERATION,),
        theta=False,
        summary="Compute the acceleration of the centre of mass of all links, along the axes of the base frame.",
    ),
    "acceleration of the centre of mass",
    *on_both(values, INPUTS),
    "centerOfMass",
    pinocchio,
    needs=Needs.STANDARD,
    beside="com_jacobian",
)
