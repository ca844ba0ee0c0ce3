"""Spatial momentum of the whole robot about the base frame's origin."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.momentum_and_energy import total_momentum
from psdmc.dynamics.scalar import Scalar, add, cross
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q, QD)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    """Compute the robot's momentum with the masses and inertias of the links in the robot file. Base parameters give
    the right torques, but not the right momentum."""
    linear, angular = total_momentum(robot.frames, robot.solids(), q, qd)
    turned = robot.in_base(linear)
    return {"h": [*turned, *add(robot.in_base(angular), cross(robot.root[1], turned))]}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return Pinocchio's momentum about the centre of mass c, moved to the base's origin: L_O = L_C + c x p."""
    import pinocchio as pin

    def moved(model: Any, data: Any, q: Array, qd: Array) -> Array:
        about_centre = pin.computeCentroidalMomentum(model, data, q, qd)
        linear = np.array(about_centre.linear)
        return np.concatenate([linear, about_centre.angular + np.cross(data.com[0], linear)])

    return {"h": robot.each(moved, given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "momentum",
        150,
        "linear momentum (kg m/s), then angular momentum about the base frame's origin (kg m^2/s) of all links, along the "
        "base frame's axes, drive inertias not included",
        INPUTS,
        (
            Quantity(
                "h",
                ("6",),
                means="linear momentum (kg m/s), then angular momentum (kg m^2/s), along the axes of the base frame; "
                "drive inertias (motors and gears) are not included",
                unit="J s",
                powers=(-1,),
            ),
        ),
        theta=False,
        summary="Compute the linear momentum of all links, and their angular momentum about the origin of the base frame.",
    ),
    "momentum",
    *on_both(values, INPUTS),
    "computeCentroidalMomentum",
    pinocchio,
    needs=Needs.STANDARD,
)
