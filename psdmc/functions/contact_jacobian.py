"""The Jacobian of the contacts in the base frame: their velocities per unit joint rate."""

from __future__ import annotations

from psdmc.dynamics.constraints import contact_jacobian
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import frame_jacobian
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.contacts import ROW_WORDS
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    return {"J": contact_jacobian(robot.frames, robot.named, q, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"J": robot.of_contacts(frame_jacobian.RECIPE.pinocchio(robot, given)["J"])}


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
