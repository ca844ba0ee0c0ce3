"""Accelerations of the named frames."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.kinematics import frame_accelerations
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import QD, QDD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q, QD, QDD)
ACCELERATION = Quantity(
    "a",
    ("frames", "6"),
    means="linear acceleration of the frame's origin (m/s^2), then angular acceleration (rad/s^2), along "
    "the axes of the base frame; gravity is not added",
    unit="1/s^2",
    powers=(0, 1),
)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar], qdd: list[Scalar]) -> Outputs:
    return {"a": frame_accelerations(robot.frames, robot.named, q, qd, qdd, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"a": accelerations(robot, given["q"], given["qd"], given["qdd"])}


def accelerations(
    robot: Reference, q: Array, qd: Array, qdd: Array, axes: str = "LOCAL_WORLD_ALIGNED"
) -> Array:
    """Return Pinocchio's accelerations (k, frames, 6) of the named frames along `axes`, a name of
    pinocchio.ReferenceFrame."""
    import pinocchio as pin

    along, frames = getattr(pin, axes), robot.frame_ids

    def of_frames(model: Any, data: Any, q: Array, qd: Array, qdd: Array) -> Array:
        pin.forwardKinematics(model, data, q, qd, qdd)
        found = (pin.getFrameClassicalAcceleration(model, data, frame, along) for frame in frames)
        return np.array([motion.vector for motion in found])

    return robot.each(of_frames, q, qd, qdd)


RECIPE = Recipe(
    Signature(
        "frame_acceleration",
        402,
        "linear then angular acceleration of every named frame, J qdd + dJ/dt qd, base frame",
        INPUTS,
        (ACCELERATION,),
        theta=False,
        summary="Compute the acceleration of each named frame, along the axes of the base frame. It is J qdd + "
        "(dJ/dt) qd, with the Jacobian J of the frame.",
    ),
    "frame acceleration",
    *on_both(values, INPUTS),
    "getFrameClassicalAcceleration",
    pinocchio,
    beside="frame_jacobian",
)
