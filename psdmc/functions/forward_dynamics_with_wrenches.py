"""Forward dynamics with external wrenches at the named frames."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, TAU, Q, Signature
from psdmc.recipes.directions import solved
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, accelerations_and_pivots
from psdmc.recipes.wrenches import (
    WRENCHES,
    jacobians_on_arrays,
    times_wrenches,
    wrenches_on_links,
)


def trace(g: Ingredients) -> Outputs:
    qdd, pivots = accelerations_and_pivots(g, g.inputs["tau"], wrenches_on_links(g))
    return {"qdd": list(qdd), "pivot": list(pivots)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    """Add M^-1 J^T wrenches to the accelerations from which the torques were computed, which are exact."""
    load = times_wrenches(jacobians_on_arrays(robot, given), given[WRENCHES.name])
    return {"qdd": given["qdd"] + solved(robot.mass_matrix(given["q"]), load)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    states = (given[name] for name in ("q", "qd", "tau", WRENCHES.name))
    return {"qdd": robot.forward_dynamics(*states)}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_with_wrenches",
        430,
        "joint accelerations that torques and external wrenches cause, qdd = M(q)^-1 (tau + sum of J^T wrench - h(q, qd)); "
        "a wrench is the force (N), then the moment (N m) about the frame's origin, that the world exerts on a named frame, "
        "along that frame's own axes",
        (Q, QD, TAU, WRENCHES),
        (QDD,),
        theta=True,
        summary="Compute the joint accelerations that torques and external wrenches (forces and moments) cause: "
        "qdd = M(q)^-1 (tau + J^T wrenches - h(q, qd)). The wrenches act on the named frames, and J is the "
        "Jacobian of these frames along their own axes. M is the mass matrix, h the sum of the Coriolis, "
        "centrifugal and gravity torques.",
        factorises=(MASS_MATRIX,),
        spoilt="accelerations",
    ),
    "forward dynamics with wrenches",
    trace,
    reference,
    "aba with fext",
    pinocchio,
    starts="inverse_dynamics",
    accelerates=True,
)
