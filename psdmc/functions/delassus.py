"""The Delassus matrix of contacts and closed loops: their accelerations per unit force."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.constraints import Constraints
from psdmc.dynamics.solve import factorize, projected
from psdmc.functions import contact_jacobian, loop_jacobian
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.contacts import CONSTRAINT_WORDS, joined
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX
from psdmc.reproducible import solved, times


def trace(g: Ingredients) -> Outputs:
    q = g.inputs["q"]
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, q, g.choices))
    rows = Constraints(g.frames, g.named, g.loops, g.root).jacobian(q)
    return {"D": projected(factors, rows), "pivot": list(factors.pivots)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q = given["q"]
    rows = contact_jacobian.RECIPE.reference(robot, given)["J"]
    if robot.chain.loops:
        rows = joined(rows, loop_jacobian.RECIPE.reference(robot, given)["J"])
    found = times(rows, solved(robot.mass_matrix(q), np.swapaxes(rows, -1, -2)))
    return {"D": (found + np.swapaxes(found, -1, -2)) / 2}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    rows = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    if robot.loops:
        rows = joined(rows, loop_jacobian.RECIPE.pinocchio(robot, given)["J"])
    return {"D": rows @ np.linalg.solve(robot.mass_matrix(given["q"]), np.swapaxes(rows, -1, -2))}


RECIPE = Recipe(
    Signature(
        "delassus",
        330,
        "J M(q)^-1 J^T of all contacts, both triangles; J as in contact_jacobian, then the rows of closed loops, if the "
        "robot has any, as in loop_jacobian",
        (Q,),
        (
            Quantity(
                "D",
                ("constraint_rows", "constraint_rows"),
                means=f"symmetric matrix {CONSTRAINT_WORDS.format('rows and columns')}",
                unit="1/(J s^2)",
                powers=(1, 1),
            ),
        ),
        theta=True,
        summary="Compute the Delassus matrix J M^-1 J^T of all contacts. J is the Jacobian of the contacts "
        "(`contact_jacobian`), and M the mass matrix. The rows of closed loops follow those of the contacts.",
        factorises=(MASS_MATRIX,),
    ),
    "Delassus matrix",
    trace,
    reference,
    "crba, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
    matters=("fold_double_angle",),
    closes=True,
)
