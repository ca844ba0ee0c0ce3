"""Geometric Jacobians of the named frames, along the base's axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.kinematics import frame_jacobians
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    return {"J": frame_jacobians(robot.frames, robot.named, q, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def jacobians(model: Any, data: Any, q: Array) -> Array:
        aligned = pin.LOCAL_WORLD_ALIGNED
        found = [pin.computeFrameJacobian(model, data, q, frame, aligned) for frame in robot.frame_ids]
        return np.reshape(found, (-1, 6, model.nv))

    return {"J": robot.each(jacobians, given["q"])}


RECIPE = Recipe(
    Signature(
        "frame_jacobian",
        110,
        "linear then angular velocity of every named frame per unit joint rate, base frame",
        INPUTS,
        (
            Quantity(
                "J",
                ("frames", "6", "nv"),
                means="three rows for the linear velocity of the frame's origin (m/s), three for the angular velocity "
                "(rad/s); column j is for qd[j]",
                unit="1",
                powers=(0, 1, -1),
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of each named frame: J qd is the frame's velocity along the axes of the base frame.",
    ),
    "frame Jacobian",
    *on_both(values, INPUTS),
    "computeFrameJacobian",
    pinocchio,
)
