"""The drift of the contacts: their accelerations at constant joint rates, dJ/dt qd."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING

from psdmc.dynamics.contacts import contact_drift
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.contacts import ROW_WORDS, drift_by_pinocchio
from psdmc.recipes.on_arrays import RobotOnArrays, columns
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference


def trace(g: Ingredients) -> Outputs:
    return {"drift": contact_drift(g.frames, g.named, g.inputs["q"], g.inputs["qd"], g.root)}


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    q, qd = given["q"], given["qd"]
    return {"drift": columns(contact_drift(robot.frames, robot.chain.frames, list(q.T), list(qd.T)), len(q))}


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    return {"drift": robot.each(partial(drift_by_pinocchio, robot), given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "contact_drift",
        320,
        "accelerations of all contacts at constant qd (dJ/dt qd), base frame",
        (Q, QD),
        (Quantity("drift", ("contact_rows",), means=ROW_WORDS, unit="1/s^2", powers=(1,)),),
        theta=False,
        summary="Compute (dJ/dt) qd of all contacts, their accelerations if qdd = 0, along the axes of the base frame.",
    ),
    "contact drift",
    trace,
    reference,
    "getFrameClassicalAcceleration",
    pinocchio,
    beside="contact_jacobian",
)
