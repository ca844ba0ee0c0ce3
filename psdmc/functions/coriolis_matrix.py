"""The Coriolis matrix of Slotine and Li."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.scalar import ZERO, Scalar
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import moved_by, torques


def trace(g: Ingredients) -> Outputs:
    """Compute column j of the Coriolis matrix: the Slotine-Li torques of a unit reference rate of joint j, without
    gravity.

    Column j needs only the bodies that joint j moves, and the bodies between joint j and the base. The first column is
    computed with all bodies: this fixes the order of the operations that later columns share.
    """
    nv = len(g.still)
    columns = []
    for j in range(nv):
        part, rates = moved_by(g, j) if j else (g, tuple(range(nv)))
        unit: list[Scalar] = [1.0 if i == j else 0.0 for i in rates]
        column: list[Scalar] = [0.0] * nv
        for i, torque in zip(rates, torques(part, part.inputs["qd"], part.still, ZERO, unit), strict=True):
            column[i] = torque
        columns.append(column)
    return {"C": list(zip(*columns, strict=True))}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    """Compute column j of the Coriolis matrix as the Slotine-Li torques at the rates qd, with a unit reference rate of
    joint j. All columns are computed in one call, as additional states."""
    nv, count = robot.nv, len(given["q"])
    q, qd = (np.tile(given[name], (nv, 1)) for name in ("q", "qd"))
    units = np.repeat(np.eye(nv), count, axis=0)
    columns = robot.torques(q, qd, np.zeros_like(qd), ZERO, qd_r=units)
    return {"C": np.moveaxis(columns.reshape(nv, count, nv), 0, -1)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"C": robot.coriolis_matrix(given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "coriolis_matrix",
        50,
        "Coriolis matrix C(q, qd), for which dM/dt - 2 C is skew-symmetric",
        (Q, QD),
        (
            Quantity(
                "C",
                ("nv", "nv"),
                means="Coriolis matrix; C qd is in N m, or N for sliding joints",
                unit="J s",
                powers=(-1, -1),
            ),
        ),
        theta=True,
        summary="Compute the Coriolis matrix C(q, qd): C qd are the Coriolis and centrifugal torques. psdmc "
        "chooses C such that dM/dt - 2 C is skew-symmetric, with the mass matrix M.",
    ),
    "Coriolis matrix",
    trace,
    reference,
    "computeCoriolisMatrix",
    pinocchio,
    shares="inverse_dynamics",
    default=True,
    beside="mass_matrix",
)
