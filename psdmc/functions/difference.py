"""The constant rates at which a robot moves from one position to another in one second."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.manifold import difference
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both

FROM, TO = (
    Quantity(
        "q0",
        ("nq",),
        np.pi,
        means="joint positions at the start, rad or m; a ball joint or floating base has a unit quaternion (x, y, z, w)",
        unit="1",
        powers=(1,),
    ),
    Quantity(
        "q1",
        ("nq",),
        np.pi,
        means="joint positions at the end, in the same form as q0",
        unit="1",
        powers=(1,),
    ),
)
WAY = Quantity(
    "v",
    ("nv",),
    means="displacement: q1 - q0 for joints with one coordinate. For a ball joint, it is the rotation vector (rad) "
    "of the shorter rotation from q0 to q1, along the axes of the body. For a floating base, it is the constant linear "
    "and angular velocity along the base's own axes, times the time from q0 to q1",
    unit="1",
    powers=(1,),
)


def values(robot: PlacedRobot, start: list[Scalar], end: list[Scalar]) -> Outputs:
    return {"v": difference(robot.frames, start, end)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    ends = given[FROM.name], given[TO.name]
    return {"v": robot.each(lambda model, _, start, end: pin.difference(model, start, end), *ends)}


RECIPE = Recipe(
    Signature(
        "difference",
        224,
        "v with integrate(q0, v) = q1: q1 - q0 where joints have one coordinate; turns the short way round, about the axes "
        "of q0's own frames",
        (FROM, TO),
        (WAY,),
        theta=False,
        summary="Compute the displacement v that leads from q0 to q1: integrate(q0, v) = q1.",
    ),
    "way between two positions",
    *on_both(values, (FROM, TO)),
    "difference",
    pinocchio,
    matters=(),
    default_where_wide=True,
)
