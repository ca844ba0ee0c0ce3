"""The neutral position q, at which no joint has moved: zero for each joint coordinate, and quaternions without
rotation."""

from __future__ import annotations

from dataclasses import replace

from psdmc.dynamics.coordinates import neutral
from psdmc.program.signature import Q, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both


def values(robot: PlacedRobot) -> Outputs:
    return {"q": neutral(robot.frames)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    return {"q": robot.each(lambda model, *_: pin.neutral(model), given["q"])}


RECIPE = Recipe(
    Signature(
        "neutral",
        220,
        "q at which no joint has moved: zeros, and unit quaternions (cosines) of no turn",
        (),
        (
            replace(
                Q,
                means="joint positions, rad or m: zero, and for quaternions (0, 0, 0, 1), which is no rotation",
            ),
        ),
        theta=False,
        summary="Return the configuration in which no joint has moved.",
    ),
    "neutral position",
    *on_both(values, ()),
    "neutral",
    pinocchio,
    matters=(),
    default_where_wide=True,
)
