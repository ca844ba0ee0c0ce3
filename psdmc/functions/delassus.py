"""The Delassus matrix of the contacts: their accelerations per unit contact force."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics import contacts
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.solve import factorize, projected
from psdmc.functions import contact_jacobian
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.accelerations import MASS_MATRIX
from psdmc.recipes.contacts import ROW_WORDS
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.reproducible import solved, times


def trace(g: Ingredients) -> Outputs:
    q = g.inputs["q"]
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, q, g.choices))
    rows = contacts.contact_jacobian(g.frames, g.named, q, g.root)
    return {"D": projected(factors, rows), "pivot": list(factors.pivots)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q = given["q"]
    rows = contact_jacobian.RECIPE.reference(robot, given)["J"]
    found = times(rows, solved(robot.mass_matrix(q), np.swapaxes(rows, -1, -2)))
    return {"D": (found + np.swapaxes(found, -1, -2)) / 2}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    rows = contact_jacobian.RECIPE.pinocchio(robot, given)["J"]
    return {"D": rows @ np.linalg.solve(robot.mass_matrix(given["q"]), np.swapaxes(rows, -1, -2))}


RECIPE = Recipe(
    Signature(
        "delassus",
        330,
        "J M(q)^-1 J^T of all contacts, both triangles; J as in contact_jacobian",
        (Q,),
        (
            Quantity(
                "D",
                ("contact_rows", "contact_rows"),
                means=f"symmetric matrix {ROW_WORDS.format('rows and columns')}",
                unit="1/(J s^2)",
                powers=(1, 1),
            ),
        ),
        theta=True,
        summary="Compute the Delassus matrix J M^-1 J^T of all contacts. J is the Jacobian of the contacts "
        "(`contact_jacobian`), and M the mass matrix.",
        factorises=(MASS_MATRIX,),
    ),
    "Delassus matrix",
    trace,
    reference,
    "crba, computeFrameJacobian",
    pinocchio,
    shares="inverse_dynamics",
    matters=("fold_double_angle",),
)
