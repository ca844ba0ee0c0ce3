"""Jacobians of the named frames along their own axes: derivatives of their placements in the tangent space."""

from __future__ import annotations

from psdmc.dynamics.kinematics import local_jacobians
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    return {"J": local_jacobians(robot.frames, robot.named, q)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"J": robot.local_frame_jacobians(given["q"])}


RECIPE = Recipe(
    Signature(
        "frame_jacobian_local",
        400,
        "linear then angular velocity of every named frame per unit joint rate, along the frame's own axes: the derivatives "
        "of its placement in the tangent space",
        INPUTS,
        (
            Quantity(
                "J",
                ("frames", "6", "nv"),
                means="three rows for the linear velocity of the frame's origin (m/s), three for the angular "
                "velocity (rad/s), along the axes of the named frame; column j is for qd[j]",
                unit="1",
                powers=(0, 1, -1),
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of each named frame: J qd is the frame's velocity along the frame's own axes.",
    ),
    "frame Jacobian along the frame's axes",
    *on_both(values, INPUTS),
    "computeFrameJacobian, LOCAL",
    pinocchio,
)
