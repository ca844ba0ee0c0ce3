"""The constant rates at which a robot moves from one position to another in one second."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.manifold import difference
from psdmc.program.signature import Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, columns
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference
from psdmc.robot.mechanism import Array

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


def trace(g: Ingredients) -> Outputs:
    return {"v": difference(g.frames, g.inputs[FROM.name], g.inputs[TO.name])}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    start, end = given[FROM.name], given[TO.name]
    return {"v": columns(difference(robot.frames, list(start.T), list(end.T)), len(start))}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def between(model: pin.Model, data: pin.Data, start: Array, end: Array) -> Array:
        return np.asarray(pin.difference(model, start, end))

    return {"v": robot.each(between, given[FROM.name], given[TO.name])}


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
    trace,
    reference,
    "difference",
    pinocchio,
    matters=(),
    default_where_wide=True,
)
