"""Inverse dynamics with external wrenches at the named frames."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, TAU, Q, Signature
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import torques
from psdmc.recipes.wrenches import (
    WRENCHES,
    wrenches_on_arrays,
    wrenches_on_links,
)


def trace(g: Ingredients) -> Outputs:
    external = wrenches_on_links(g)
    return {"tau": torques(g, g.inputs["qd"], g.inputs["qdd"], g.base_acceleration, external=external)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, qd, qdd = (given[name] for name in ("q", "qd", "qdd"))
    external = wrenches_on_arrays(robot, given)
    return {"tau": robot.torques(q, qd, qdd, robot.base_acceleration, external=external)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    states = (given[name] for name in ("q", "qd", "qdd", WRENCHES.name))
    return {"tau": robot.inverse_dynamics(*states)}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_with_wrenches",
        160,
        "tau = M(q) qdd + h(q, qd) - sum of J^T wrench; a wrench is the force (N), then the moment (N m) about the "
        "frame's origin, that the world exerts on a named frame, along that frame's own axes",
        (Q, QD, QDD, WRENCHES),
        (TAU,),
        theta=True,
        summary="Compute the joint torques of a motion under external wrenches (forces and moments): tau = M(q) "
        "qdd + h(q, qd) - J^T wrenches. The wrenches act on the named frames, and J is the Jacobian of these "
        "frames along their own axes. M is the mass matrix, h the sum of the Coriolis, centrifugal and gravity "
        "torques.",
    ),
    "inverse dynamics with wrenches",
    trace,
    reference,
    "rnea with fext",
    pinocchio,
    shares="inverse_dynamics",
)
