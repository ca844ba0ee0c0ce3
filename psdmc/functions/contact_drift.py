"""The drift of the contacts: their accelerations at constant joint rates, dJ/dt qd."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.constraints import contact_drift
from psdmc.dynamics.scalar import Scalar
from psdmc.functions.frame_acceleration import accelerations
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.contacts import ROW_WORDS
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q, QD)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    return {"drift": contact_drift(robot.frames, robot.named, q, qd, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"drift": drift(robot, given, "LOCAL_WORLD_ALIGNED")}


def drift(robot: Reference, given: Given, axes: str) -> Array:
    """Return Pinocchio's accelerations of the contacts at constant joint rates, (k, rows), along `axes`, a name of
    pinocchio.ReferenceFrame."""
    q, qd = given["q"], given["qd"]
    found = accelerations(robot, q, qd, np.zeros_like(qd), axes)
    return robot.of_contacts(found[..., None])[..., 0]


RECIPE = Recipe(
    Signature(
        "contact_drift",
        320,
        "accelerations of all contacts at constant qd (dJ/dt qd), base frame",
        INPUTS,
        (
            Quantity(
                "drift",
                ("contact_rows",),
                means=f"accelerations of the contacts (m/s^2, rad/s^2) {ROW_WORDS.format('entries')}",
                unit="1/s^2",
                powers=(1,),
            ),
        ),
        theta=False,
        summary="Compute the accelerations that all contacts have if qdd = 0, along the axes of the base frame. "
        "These accelerations are (dJ/dt) qd, with the Jacobian J of the contacts (`contact_jacobian`).",
    ),
    "contact drift",
    *on_both(values, INPUTS),
    "getFrameClassicalAcceleration",
    pinocchio,
    beside="contact_jacobian",
)
