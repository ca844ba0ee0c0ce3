"""The Jacobian of the contacts along their own axes: their velocities per unit joint rate."""

from __future__ import annotations

from dataclasses import replace

from psdmc.dynamics.kinematics import local_jacobians
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import contact_jacobian
from psdmc.program.signature import Q, Signature
from psdmc.recipes.contacts import LOCAL_ROW_WORDS
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q,)
(ALIGNED,) = contact_jacobian.RECIPE.signature.outputs


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    found = zip(robot.named, local_jacobians(robot.frames, robot.named, q), strict=True)
    return {"J": [row for each, rows in found for row in rows[: each.rows]]}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"J": robot.of_contacts(robot.local_frame_jacobians(given["q"]))}


RECIPE = Recipe(
    Signature(
        "contact_jacobian_local",
        312,
        "velocities of all contacts per unit joint rate, along the contacts' own axes",
        INPUTS,
        (
            replace(
                ALIGNED,
                means=f"Jacobian, {LOCAL_ROW_WORDS.format('rows')}. Column j is for qd[j]",
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of all contacts (links or frames that can touch the world) along each "
        "contact's own axes. J qd are the velocities of the contacts. If f are contact forces, J^T f are the "
        "joint torques that they cause.",
    ),
    "contact Jacobian along the contacts' axes",
    *on_both(values, INPUTS),
    "computeFrameJacobian, LOCAL",
    pinocchio,
)
