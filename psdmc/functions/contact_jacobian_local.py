"""The Jacobian of the contacts along their own axes: their velocities per unit joint rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from psdmc.dynamics.kinematics import local_jacobians
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import contact_jacobian
from psdmc.program.signature import Q, Signature
from psdmc.recipes.contacts import LOCAL_ROW_WORDS
from psdmc.recipes.recipe import Arrays, Outputs, PlacedRobot, Recipe, on_both
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

INPUTS = (Q,)
(ALIGNED,) = contact_jacobian.RECIPE.signature.outputs


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    found = zip(robot.named, local_jacobians(robot.frames, robot.named, q), strict=True)
    return {"J": [row for each, rows in found for row in rows[: each.rows]]}


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
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
