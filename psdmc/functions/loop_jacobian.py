"""The Jacobian of the closed loops: velocities per unit joint rate, in the directions that the loops block."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.closed_loops import loop_jacobian
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.closed_loops import ROW_WORDS, of_loops
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    return {"J": loop_jacobian(robot.frames, robot.loops, q, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def found(model: Any, data: Any, q: Array) -> Array:
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)

        def jacobian(a: int, b: int, rows: tuple[int, ...]) -> Array:
            first, second = (
                np.reshape(pin.getFrameJacobian(model, data, k, pin.LOCAL_WORLD_ALIGNED), (2, 3, -1))
                for k in (a, b)
            )
            apart = data.oMf[b].translation - data.oMf[a].translation
            seen = second - first
            seen[0] -= np.cross(first[1], apart, axisa=0, axisc=0)
            return np.concatenate(data.oMf[a].rotation.T @ seen)[list(rows)]

        return of_loops(robot, jacobian)

    return {"J": robot.each(found, given["q"])}


RECIPE = Recipe(
    Signature(
        "loop_jacobian",
        452,
        "velocities of the closed loops per unit joint rate: of the second frame seen from the first one, along the first "
        "one's axes",
        INPUTS,
        (
            Quantity(
                "J",
                ("loop_rows", "nv"),
                means="Jacobian: J qd is the velocity of each loop's second frame seen from its first frame, "
                f"{ROW_WORDS.format('row')}. Column j is for qd[j]",
                unit="1",
                powers=(1, -1),
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of the closed loops. A closed loop keeps two frames together in the "
        "directions that the loop blocks. A motion that keeps the loops closed has J qd = 0.",
    ),
    "loop Jacobian",
    *on_both(values, INPUTS),
    "getFrameJacobian",
    pinocchio,
    needs=Needs.LOOPS,
)
