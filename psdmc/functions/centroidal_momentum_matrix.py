"""The matrix that computes the whole robot's momentum about its centre of mass from the joint rates."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.momentum_and_energy import first_moment, momentum_matrix
from psdmc.dynamics.scalar import Scalar, cross, scale
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q,)


def values(robot: PlacedRobot, q: list[Scalar]) -> Outputs:
    """Subtract the centre of mass times the linear momentum from the momentum about the origin."""
    bodies = robot.solids()
    centre = scale(first_moment(robot.frames, bodies, q), 1.0 / robot.mass)
    columns = []
    for px, py, pz, *angular in zip(*momentum_matrix(robot.frames, bodies, q), strict=True):
        linear = (px, py, pz)
        x, y, z = (a - b for a, b in zip(angular, cross(centre, linear), strict=True))
        columns.append([v for part in (linear, (x, y, z)) for v in robot.in_base(part)])
    return {"A": list(zip(*columns, strict=True))}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    return {"A": robot.each(lambda *at: np.reshape(pin.computeCentroidalMap(*at), (6, -1)), given["q"])}


RECIPE = Recipe(
    Signature(
        "centroidal_momentum_matrix",
        175,
        "matrix A(q): A qd is the linear momentum (kg m/s), then the angular momentum about the centre of mass (kg m^2/s) "
        "of all links, along the base frame's axes",
        INPUTS,
        (
            Quantity(
                "A",
                ("6", "nv"),
                means="three rows for the linear momentum (kg m/s), three for the angular momentum "
                "(kg m^2/s), along the axes of the base frame",
                unit="J s^2",
                powers=(-1, -1),
            ),
        ),
        theta=False,
        summary="Compute the centroidal momentum matrix A(q): A qd is the linear momentum of all links, then their "
        "angular momentum about their centre of mass.",
    ),
    "centroidal momentum matrix",
    *on_both(values, INPUTS),
    "computeCentroidalMap",
    pinocchio,
    needs=Needs.STANDARD,
)
