"""Jacobian of the contacts in the base frame."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from psdmc.dynamics.contacts import contact_jacobian
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.contacts import ROW_WORDS, jacobian_by_pinocchio
from psdmc.recipes.on_arrays import RobotOnArrays, matrix
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference


def trace(g: Ingredients) -> Outputs:
    return {"J": contact_jacobian(g.frames, g.named, g.inputs["q"], g.root)}


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    q = given["q"]
    return {"J": matrix(contact_jacobian(robot.frames, robot.chain.frames, list(q.T)), len(q))}


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    return {"J": robot.each(partial(jacobian_by_pinocchio, robot), given["q"])}


RECIPE = Recipe(
    Signature(
        "contact_jacobian",
        310,
        "velocities of all contacts per unit joint rate, base frame",
        (Q,),
        (
            Quantity(
                "J",
                ("contact_rows", "nv"),
                means=f"{ROW_WORDS}; column j for qd[j]",
                unit="1",
                powers=(1, -1),
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of all contacts: J qd are the velocities of the contacts along the axes of the base "
        "frame.",
    ),
    "contact Jacobian",
    trace,
    reference,
    "computeFrameJacobian",
    pinocchio,
)
