"""The drift of the closed loops, dJ/dt qd: accelerations at constant joint rates, in the directions that the loops
block."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.closed_loops import loop_drift
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.closed_loops import ROW_WORDS, of_loops
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q, QD)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    return {"drift": loop_drift(robot.frames, robot.loops, q, qd, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def found(model: Any, data: Any, q: Array, qd: Array) -> Array:
        pin.forwardKinematics(model, data, q, qd, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)

        def drift(a: int, b: int, rows: tuple[int, ...]) -> Array:
            aligned = pin.LOCAL_WORLD_ALIGNED
            first, second = (pin.getFrameVelocity(model, data, k, aligned) for k in (a, b))
            own, other = (pin.getFrameClassicalAcceleration(model, data, k, aligned) for k in (a, b))
            apart, w = data.oMf[b].translation - data.oMf[a].translation, first.angular
            seen = second.linear - first.linear - np.cross(w, apart)
            carried = np.cross(own.angular, apart) + np.cross(w, np.cross(w, apart)) + 2.0 * np.cross(w, seen)
            angular = other.angular - own.angular - np.cross(w, second.angular)
            turned = data.oMf[a].rotation.T
            return np.append(turned @ (other.linear - own.linear - carried), turned @ angular)[list(rows)]

        return of_loops(robot, drift)

    return {"drift": robot.each(found, given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "loop_drift",
        454,
        "accelerations of the closed loops at constant qd (dJ/dt qd), along the axes of the loops' first frames",
        INPUTS,
        (
            Quantity(
                "drift",
                ("loop_rows",),
                means="accelerations (m/s^2, rad/s^2) at constant qd of each loop's second frame seen from its first frame, "
                f"{ROW_WORDS.format('entry')}",
                unit="1/s^2",
                powers=(1,),
            ),
        ),
        theta=False,
        summary="Compute the product (dJ/dt) qd, with the Jacobian J of the closed loops. A closed loop keeps two "
        "frames together in the directions that the loop blocks. A motion that keeps the loops closed has J qdd + "
        "(dJ/dt) qd = 0.",
    ),
    "loop drift",
    *on_both(values, INPUTS),
    "getFrameClassicalAcceleration",
    pinocchio,
    beside="loop_jacobian",
    needs=Needs.LOOPS,
)
