"""The matrix that computes the whole robot's momentum about its centre of mass from the joint rates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from psdmc.dynamics.frames import Frame
from psdmc.dynamics.momentum_and_energy import first_moment, momentum_matrix
from psdmc.dynamics.scalar import Matrix, Scalar, cross, scale, transform
from psdmc.dynamics.spatial import Body
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Needs, Outputs, Recipe, Reference
from psdmc.robot.mechanism import Array


def trace(g: Ingredients) -> Outputs:
    return {
        "A": _rows(g.frames, g.link_bodies(), g.inputs["q"], g.base_axes),
    }


def _rows(
    frames: Sequence[Frame], bodies: Sequence[Body], q: Sequence[Scalar], axes: Matrix | None
) -> list[list[Scalar]]:
    """6 x nv; momentum about the origin, less the centre of mass times the linear momentum."""
    mass = sum(body.mass for body in bodies)
    centre = scale(first_moment(frames, bodies, q), 1.0 / mass)
    columns = []
    for px, py, pz, *angular in zip(*momentum_matrix(frames, bodies, q), strict=True):
        linear = (px, py, pz)
        x, y, z = (a - b for a, b in zip(angular, cross(centre, linear), strict=True))
        parts = (linear, (x, y, z))
        columns.append([v for part in parts for v in (part if axes is None else transform(axes, part))])
    return [list(row) for row in zip(*columns, strict=True)]


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q = given["q"]
    return {"A": entries(_rows(robot.frames, robot.solids, list(q.T), None), len(q))}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def matrix(model: Any, data: Any, q: Array) -> Array:
        return np.reshape(pin.computeCentroidalMap(model, data, q), (6, model.nv))

    return {"A": robot.each(matrix, given["q"])}


RECIPE = Recipe(
    Signature(
        "centroidal_momentum_matrix",
        175,
        "matrix A(q): A qd is the linear momentum (kg m/s), then the angular momentum about the centre of "
        "mass (kg m^2/s) of all "
        "links, along the base frame's axes",
        (Q,),
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
    trace,
    reference,
    "computeCentroidalMap",
    pinocchio,
    needs=Needs.STANDARD,
)
