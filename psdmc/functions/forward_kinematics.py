"""Forward kinematics: where the named frames are."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.named_frames import placed_frames
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference
from psdmc.robot.mechanism import Array


def trace(g: Ingredients) -> Outputs:
    points, rotations = zip(*placed_frames(g.frames, g.named, g.inputs["q"], g.root), strict=True)
    return {"position": points, "rotation": rotations}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q = given["q"]
    placed = placed_frames(robot.frames, robot.chain.frames, list(q.T))
    points, rotations = zip(*placed, strict=True)
    return {"position": entries(points, len(q)), "rotation": entries(rotations, len(q))}


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
        (Q,),
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
    trace,
    reference,
    "framesForwardKinematics",
    pinocchio,
)
