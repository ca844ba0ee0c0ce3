"""The drift of the contacts along their own axes: their accelerations at constant joint rates."""

from __future__ import annotations

from dataclasses import replace

from psdmc.dynamics.kinematics import local_accelerations
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import contact_drift
from psdmc.program.signature import QD, Q, Signature
from psdmc.recipes.contacts import LOCAL_ROW_WORDS
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q, QD)
(ALIGNED,) = contact_drift.RECIPE.signature.outputs


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    found = local_accelerations(robot.frames, robot.named, q, qd, [0.0] * len(qd))
    pairs = zip(robot.named, found, strict=True)
    return {"drift": [value for each, own in pairs for value in own[: each.rows]]}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"drift": contact_drift.drift(robot, given, "LOCAL")}


RECIPE = Recipe(
    Signature(
        "contact_drift_local",
        322,
        "accelerations of all contacts at constant qd, along the contacts' own axes",
        INPUTS,
        (
            replace(
                ALIGNED,
                means=f"accelerations of the contacts (m/s^2, rad/s^2) {LOCAL_ROW_WORDS.format('entries')}",
            ),
        ),
        theta=False,
        summary="Compute the accelerations that all contacts have if qdd = 0, along each contact's own axes. For "
        "other qdd, the accelerations are J qdd + drift, with the Jacobian J of `contact_jacobian_local`.",
    ),
    "contact drift along the contacts' axes",
    *on_both(values, INPUTS),
    "getFrameClassicalAcceleration, LOCAL",
    pinocchio,
    beside="contact_jacobian_local",
)
