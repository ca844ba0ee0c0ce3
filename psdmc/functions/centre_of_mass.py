"""The whole robot's centre of mass."""

from __future__ import annotations

from psdmc.dynamics.momentum_and_energy import first_moment
from psdmc.dynamics.scalar import add, scale, transform
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Needs, Outputs, Recipe, Reference


def trace(g: Ingredients) -> Outputs:
    """Compute the centre of mass of the robot: the first moment of the links from the robot file, divided by their
    total mass."""
    bodies = g.link_bodies()
    mass, moment = sum(body.mass for body in bodies), first_moment(g.frames, bodies, g.inputs["q"])
    axes, origin = g.root
    return {"c": add(origin, scale(transform(axes, moment), 1.0 / mass))}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, mass = given["q"], sum(body.mass for body in robot.solids)
    return {"c": entries(first_moment(robot.frames, robot.solids, list(q.T)), len(q)) / mass}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    return {"c": robot.each(pin.centerOfMass, given["q"])}


RECIPE = Recipe(
    Signature(
        "centre_of_mass",
        165,
        "all links' common centre of mass (m) in the base frame",
        (Q,),
        (Quantity("c", ("3",), means="centre of mass, m", unit="m"),),
        theta=False,
        summary="Compute the position of the centre of mass of all links in the base frame.",
    ),
    "centre of mass",
    trace,
    reference,
    "centerOfMass",
    pinocchio,
    needs=Needs.STANDARD,
)
