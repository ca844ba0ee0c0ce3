"""How far the closed loops of a mechanism are from closed."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.closed_loops import loop_error
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.closed_loops import ROW_WORDS, of_loops
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    return {"error": loop_error(robot.frames, robot.loops, q, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def errors(first: Any, second: Any, rows: tuple[int, ...]) -> Array:
        between = first.actInv(second)
        angular = [row - 3 for row in rows if row >= 3]
        if len(angular) == 2:
            free = ({0, 1, 2} - {*angular}).pop()
            quaternion = pin.Quaternion.FromTwoVectors(np.eye(3)[free], between.rotation[:, free])
        else:
            quaternion = pin.Quaternion(between.rotation)
        return np.append(between.translation, 2.0 * quaternion.vec() / quaternion.w)[list(rows)]

    def found(model: Any, data: Any, q: Array) -> Array:
        pin.framesForwardKinematics(model, data, q)
        return of_loops(robot, lambda a, b, rows: errors(data.oMf[a], data.oMf[b], rows))

    return {"error": robot.each(found, given["q"])}


RECIPE = Recipe(
    Signature(
        "loop_error",
        450,
        "how far the closed loops are from closed: the second frame as seen from the first one, along the first one's axes",
        INPUTS,
        (
            Quantity(
                "error",
                ("loop_rows",),
                means="displacement of each loop's second frame from its first frame, "
                f"{ROW_WORDS.format('entry')}. A linear entry is in m. The angular entries are 2 tan(angle / 2) times "
                "the axis of the rotation, which is close to the rotation vector (rad)",
                unit="1",
                powers=(1,),
            ),
        ),
        theta=False,
        summary="Compute how far the closed loops of a mechanism are from closed. A closed loop keeps two frames "
        "together in the directions that the loop blocks. The result is the displacement between the two frames "
        "in these directions.",
    ),
    "loop error",
    *on_both(values, INPUTS),
    "framesForwardKinematics",
    pinocchio,
    needs=Needs.LOOPS,
)
