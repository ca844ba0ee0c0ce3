"""The drift of the named frames: their accelerations at constant joint rates, dJ/dt qd."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.kinematics import frame_drifts
from psdmc.dynamics.scalar import Scalar
from psdmc.functions.frame_acceleration import accelerations
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q, QD)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    return {"drift": frame_drifts(robot.frames, robot.named, q, qd, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    q, qd = given["q"], given["qd"]
    return {"drift": accelerations(robot, q, qd, np.zeros_like(qd))}


RECIPE = Recipe(
    Signature(
        "jacobian_dot_qd",
        120,
        "linear then angular acceleration of every named frame at constant qd (dJ/dt qd), base frame",
        INPUTS,
        (
            Quantity(
                "drift",
                ("frames", "6"),
                means="linear acceleration of the frame's origin (m/s^2), then angular acceleration (rad/s^2)",
                unit="1/s^2",
                powers=(0, 1),
            ),
        ),
        theta=False,
        summary="Compute the acceleration that each named frame has if qdd = 0, along the axes of the base frame. "
        "It is (dJ/dt) qd, with the Jacobian J of the frame.",
    ),
    "frame drift",
    *on_both(values, INPUTS),
    "getFrameClassicalAcceleration",
    pinocchio,
    beside="frame_jacobian",
)
