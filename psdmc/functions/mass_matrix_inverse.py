"""The inverse of the mass matrix."""

from __future__ import annotations

import numpy as np

from psdmc import reproducible
from psdmc.dynamics.arrow import any_limbs, eliminated
from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.solve import inverse
from psdmc.program.products import Thin
from psdmc.program.signature import THIN, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX


def trace(g: Ingredients) -> Outputs:
    arrow = eliminated(g.frames, mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices))
    if any_limbs(g.frames):
        is_solved = arrow.has_small_core
        factors = arrow.thin_factors(is_solved)
        return {"Minv": arrow.thin_inverse(is_solved), "pivot": arrow.pivots, THIN: factors}
    return {"Minv": inverse(arrow.factors), "pivot": arrow.pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return {"Minv": reproducible.inverse(robot.mass_matrix(given["q"]))}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    upper = np.triu(robot.each(pin.computeMinverse, given["q"]))
    return {"Minv": upper + np.swapaxes(np.triu(upper, 1), -1, -2)}


RECIPE = Recipe(
    Signature(
        "mass_matrix_inverse",
        192,
        "inverse of the mass matrix M(q), both triangles",
        (Q,),
        (
            Quantity(
                "Minv",
                ("nv", "nv"),
                means="symmetric matrix, both triangles filled; 1/(kg m^2), with sliding joints also 1/(kg m) and 1/kg",
                unit="1/(J s^2)",
                powers=(1, 1),
            ),
        ),
        theta=True,
        summary="Compute the inverse of the joint-space mass matrix M(q).",
        factorises=(MASS_MATRIX,),
        thin=(Thin("Minv"),),
    ),
    "inverse of the mass matrix",
    trace,
    reference,
    "computeMinverse",
    pinocchio,
    starts="inverse_dynamics",
    in_limbs=True,
    matters=("fold_double_angle",),
)
