"""Forward kinematics: where the named frames are."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.kinematics import placed_frames
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    points, rotations = zip(*placed_frames(robot.frames, robot.named, q, robot.root), strict=True)
    return {"position": points, "rotation": rotations}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def poses(model: Any, data: Any, q: Array) -> Array:
        pin.framesForwardKinematics(model, data, q)
        return np.array([data.oMf[frame].homogeneous for frame in robot.frame_ids])

    found = robot.each(poses, given["q"])
    return {"position": found[..., :3, 3], "rotation": found[..., :3, :3]}


RECIPE = Recipe(
    Signature(
        "forward_kinematics",
        100,
        "origin (m) and rotation matrix of every named frame in the base frame",
        INPUTS,
        (
            Quantity("position", ("frames", "3"), means="origins of the named frames, m", unit="m"),
            Quantity(
                "rotation",
                ("frames", "3", "3"),
                means="rotation matrices; column j is axis j of the named frame (x, y or z)",
                unit="1",
            ),
        ),
        theta=False,
        summary="Compute the position and the rotation matrix of each named frame in the base frame.",
    ),
    "forward kinematics",
    *on_both(values, INPUTS),
    "framesForwardKinematics",
    pinocchio,
)
