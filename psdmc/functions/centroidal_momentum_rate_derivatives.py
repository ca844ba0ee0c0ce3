"""Derivatives of the rate of the whole robot's momentum about its centre of mass."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.momentum_and_energy import momentum_rate_slopes
from psdmc.dynamics.scalar import Scalar
from psdmc.functions.centroidal_momentum_rate import INPUTS, RATE
from psdmc.program.signature import Signature, derivative_of
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

OUTPUTS = tuple(derivative_of(RATE, quantity) for quantity in INPUTS)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar], qdd: list[Scalar]) -> Outputs:
    found = momentum_rate_slopes(robot.frames, robot.solids(), q, qd, qdd)
    return {output.name: robot.rows_in_base(rows) for output, rows in zip(OUTPUTS, found, strict=True)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    def slopes(model: Any, data: Any, *state: Array) -> Array:
        _, *blocks = pin.computeCentroidalDynamicsDerivatives(model, data, *state)
        return np.reshape(blocks, (3, 6, model.nv))

    found = robot.each(slopes, given["q"], given["qd"], given["qdd"])
    return {output.name: found[:, k] for k, output in enumerate(OUTPUTS)}


RECIPE = Recipe(
    Signature(
        "centroidal_momentum_rate_derivatives",
        426,
        "derivatives by q, qd and qdd of the rate of all links' linear momentum, then of their angular momentum about the "
        "centre of mass, along the base frame's axes; those by qdd are the centroidal momentum matrix",
        INPUTS,
        OUTPUTS,
        theta=False,
        summary="Compute the derivatives by q, qd and qdd of hdot, the time derivative of the centroidal momentum "
        "h. h is the linear momentum of all links, then their angular momentum about their centre of mass, along "
        "the axes of the base frame.",
    ),
    "derivatives of the centroidal momentum's rate",
    *on_both(values, INPUTS),
    "computeCentroidalDynamicsDerivatives",
    pinocchio,
    needs=Needs.STANDARD,
    beside="centroidal_momentum_matrix",
)
