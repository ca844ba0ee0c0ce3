"""The drift of the contacts: their accelerations at constant joint rates, dJ/dt qd."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.dynamics.contacts import contact_drift
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.contacts import ROW_WORDS
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
    import pinocchio as pin

    def accelerations(model: Any, data: Any, q: Array, qd: Array) -> Array:
        pin.forwardKinematics(model, data, q, qd, np.zeros(model.nv))
        found = [
            pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).vector[:rows]
            for frame, rows in robot.contacts
        ]
        return np.concatenate(found)

    return {"drift": robot.each(accelerations, given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "contact_drift",
        320,
        "accelerations of all contacts at constant qd (dJ/dt qd), base frame",
        (Q, QD),
        (
            Quantity(
                "drift",
                ("contact_rows",),
                means=f"accelerations (m/s^2, rad/s^2) in the order of the contacts: {ROW_WORDS}",
                unit="1/s^2",
                powers=(1,),
            ),
        ),
        theta=False,
        summary="Compute the accelerations that all contacts have if qdd = 0, along the axes of the base frame. "
        "They are (dJ/dt) qd, with the Jacobian J of the contacts.",
    ),
    "contact drift",
    trace,
    reference,
    "getFrameClassicalAcceleration",
    pinocchio,
    beside="contact_jacobian",
)
