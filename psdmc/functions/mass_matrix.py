"""The mass matrix, by composite rigid bodies."""

from __future__ import annotations

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.recipe import (
    Arrays,
    Given,
    Ingredients,
    Outputs,
    Polynomials,
    Recipe,
    Reference,
    RobotOnArrays,
)


def trace(g: Ingredients) -> Outputs:
    return {"M": mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return {"M": robot.mass_matrix(given["q"])}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"M": robot.mass_matrix(given["q"])}


RECIPE = Recipe(
    Signature(
        "mass_matrix",
        30,
        "mass matrix M(q), both triangles",
        (Q,),
        (
            Quantity(
                "M",
                ("nv", "nv"),
                means="symmetric matrix, both triangles filled; kg m^2, with sliding joints also kg m and kg",
                unit="J s^2",
                powers=(-1, -1),
            ),
        ),
        theta=True,
        summary="Compute the joint-space mass matrix M(q), which includes the drive inertias (motors and gears).",
    ),
    "mass matrix",
    trace,
    reference,
    "crba",
    pinocchio,
    starts="inverse_dynamics",
    matters=("fold_double_angle",),
    polynomials=Polynomials.MASS,
    in_limbs=True,
    default=True,
    benched=True,
)
