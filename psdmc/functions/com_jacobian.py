"""The Jacobian of the whole robot's centre of mass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.dynamics.momentum import total_momentum
from psdmc.dynamics.parameters import bodies_about
from psdmc.dynamics.scalar import Scalar, scale, transform
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Ingredients, Needs, Outputs, Recipe
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference


def trace(g: Ingredients) -> Outputs:
    """Column j is the whole robot's momentum at unit rate of joint j, over its mass."""
    bodies = bodies_about(g.link_frames, g.standard)
    mass = sum(body.mass for body in bodies)
    columns = []
    nv = len(g.still)
    for j in range(nv):
        linear, _ = total_momentum(g.frames, bodies, g.inputs["q"], _unit(j, nv))
        columns.append(scale(transform(g.base_axes, linear), 1.0 / mass))
    return {"J": list(zip(*columns, strict=True))}


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    q, mass = given["q"], sum(body.mass for body in robot.solids)
    columns = [
        entries(total_momentum(robot.frames, robot.solids, list(q.T), _unit(j, robot.nv))[0], len(q))
        for j in range(robot.nv)
    ]
    return {"J": np.stack(columns, axis=-1) / mass}


def _unit(j: int, nv: int) -> list[Scalar]:
    return [1.0 if i == j else 0.0 for i in range(nv)]


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    import pinocchio as pin

    def jacobian(model: Any, data: Any, q: Array) -> Array:
        return np.reshape(pin.jacobianCenterOfMass(model, data, q), (3, model.nv))

    return {"J": robot.each(jacobian, given["q"])}


RECIPE = Recipe(
    Signature(
        "com_jacobian",
        170,
        "velocity of all links' common centre of mass per unit joint rate, base frame",
        (Q,),
        (Quantity("J", ("3", "nv")),),
        theta=False,
    ),
    "Jacobian of the centre of mass",
    trace,
    reference,
    "jacobianCenterOfMass",
    pinocchio,
    needs=Needs.STANDARD,
    beside="jacobian",
)
