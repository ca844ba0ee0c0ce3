"""The Jacobian of the whole robot's centre of mass."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.momentum_and_energy import momentum_matrix
from psdmc.dynamics.scalar import scale, transform
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Needs, Outputs, Recipe, Reference


def trace(g: Ingredients) -> Outputs:
    """Compute the Jacobian of the centre of mass. Its columns are the robot's linear momentum per unit rate of each
    joint, divided by the total mass."""
    bodies = g.link_bodies()
    mass = sum(body.mass for body in bodies)
    per_rate = zip(*momentum_matrix(g.frames, bodies, g.inputs["q"])[:3], strict=True)
    columns = [scale(transform(g.base_axes, linear), 1.0 / mass) for linear in per_rate]
    return {"J": list(zip(*columns, strict=True))}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, mass = given["q"], sum(body.mass for body in robot.solids)
    return {"J": entries(momentum_matrix(robot.frames, robot.solids, list(q.T))[:3], len(q)) / mass}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    return {"J": robot.each(lambda *at: np.reshape(pin.jacobianCenterOfMass(*at), (3, -1)), given["q"])}


RECIPE = Recipe(
    Signature(
        "com_jacobian",
        170,
        "velocity of all links' common centre of mass per unit joint rate, base frame",
        (Q,),
        (
            Quantity(
                "J",
                ("3", "nv"),
                means="column j is the velocity of the centre of mass (m/s) if qd[j] is 1 and all other rates are 0",
                unit="m",
                powers=(0, -1),
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of the centre of mass of all links: J qd is this point's velocity along "
        "the axes of the base frame.",
    ),
    "Jacobian of the centre of mass",
    trace,
    reference,
    "jacobianCenterOfMass",
    pinocchio,
    needs=Needs.STANDARD,
    beside="jacobian",
)
