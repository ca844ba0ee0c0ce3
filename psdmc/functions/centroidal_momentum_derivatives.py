"""Derivatives of the whole robot's momentum about its centre of mass by joint positions and rates."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.momentum_and_energy import momentum_rate_slopes
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import centroidal_momentum_matrix
from psdmc.functions.centroidal_momentum import INPUTS, MOMENTUM
from psdmc.program.signature import Signature, derivative_of
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    """Differentiate the momentum's rate at rest, A qdd, at qdd = qd: there it equals the momentum."""
    found = momentum_rate_slopes(robot.frames, robot.solids(), q, [0.0] * len(qd), qd)
    return {"dh_dq": robot.rows_in_base(found.by_q), "dh_dqd": robot.rows_in_base(found.by_qdd)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def slopes(model: Any, data: Any, q: Array, qd: Array) -> Array:
        found = pin.computeCentroidalDynamicsDerivatives(model, data, q, qd, np.zeros(model.nv))
        return np.reshape(found[0], (6, model.nv))

    matrix = centroidal_momentum_matrix.RECIPE.pinocchio(robot, given)["A"]
    return {"dh_dq": robot.each(slopes, given["q"], given["qd"]), "dh_dqd": matrix}


RECIPE = Recipe(
    Signature(
        "centroidal_momentum_derivatives",
        422,
        "derivatives by q and qd of all links' linear momentum, then angular momentum about the centre of mass, along the "
        "base frame's axes; those by qd are the centroidal momentum matrix",
        INPUTS,
        tuple(derivative_of(MOMENTUM, quantity) for quantity in INPUTS),
        theta=False,
        summary="Compute the derivatives by q and qd of the centroidal momentum h. h is the linear momentum of all "
        "links, then their angular momentum about their centre of mass, along the axes of the base frame.",
    ),
    "derivatives of the centroidal momentum",
    *on_both(values, INPUTS),
    "computeCentroidalDynamicsDerivatives",
    pinocchio,
    needs=Needs.STANDARD,
    beside="centroidal_momentum_matrix",
)
