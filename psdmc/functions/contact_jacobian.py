"""The Jacobian of the contacts in the base frame: their velocities per unit joint rate."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.constraints import contact_jacobian
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.contacts import ROW_WORDS
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    return {"J": contact_jacobian(robot.frames, robot.named, q, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def jacobian(model: Any, data: Any, q: Array) -> Array:
        aligned = pin.LOCAL_WORLD_ALIGNED
        found = [pin.computeFrameJacobian(model, data, q, frame, aligned) for frame, _ in robot.contacts]
        parts = zip(np.reshape(found, (-1, 6, model.nv)), robot.contacts, strict=True)
        return np.concatenate([own[:rows] for own, (_, rows) in parts])

    return {"J": robot.each(jacobian, given["q"])}


RECIPE = Recipe(
    Signature(
        "contact_jacobian",
        310,
        "velocities of all contacts per unit joint rate, base frame",
        INPUTS,
        (
            Quantity(
                "J",
                ("contact_rows", "nv"),
                means=f"Jacobian, {ROW_WORDS.format('rows')}. Column j is for qd[j]",
                unit="1",
                powers=(1, -1),
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of all contacts (links or frames that can touch the world). J qd are "
        "the velocities of the contacts along the axes of the base frame.",
    ),
    "contact Jacobian",
    *on_both(values, INPUTS),
    "computeFrameJacobian",
    pinocchio,
)
