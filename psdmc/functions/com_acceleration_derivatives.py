"""Derivatives of the acceleration of the whole robot's centre of mass by joint positions, rates and accelerations."""

from __future__ import annotations

from psdmc.dynamics.momentum_and_energy import momentum_rate_slopes
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import centroidal_momentum_rate_derivatives
from psdmc.functions.com_acceleration import ACCELERATION, INPUTS
from psdmc.program.signature import Signature, derivative_of
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both

OUTPUTS = tuple(derivative_of(ACCELERATION, quantity) for quantity in INPUTS)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar], qdd: list[Scalar]) -> Outputs:
    found = momentum_rate_slopes(robot.frames, robot.solids(), q, qd, qdd)
    blocks = (robot.rows_in_base(rows[:3], 1.0 / robot.mass) for rows in found)
    return {output.name: rows for output, rows in zip(OUTPUTS, blocks, strict=True)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Divide Pinocchio's derivatives of the force by the mass."""
    found = centroidal_momentum_rate_derivatives.RECIPE.pinocchio(robot, given)
    mass = sum(inertia.mass for inertia in list(robot.model.inertias)[1:])
    return {output.name: rows[:, :3] / mass for output, rows in zip(OUTPUTS, found.values(), strict=True)}


RECIPE = Recipe(
    Signature(
        "com_acceleration_derivatives",
        416,
        "derivatives by q, qd and qdd of the acceleration of all links' common centre of mass, base frame; those by qdd are "
        "its Jacobian",
        INPUTS,
        OUTPUTS,
        theta=False,
        summary="Compute the derivatives by q, qd and qdd of the acceleration a of the centre of mass of all links. "
        "a is along the axes of the base frame.",
    ),
    "derivatives of the centre of mass's acceleration",
    *on_both(values, INPUTS),
    "computeCentroidalDynamicsDerivatives",
    pinocchio,
    needs=Needs.STANDARD,
    beside="com_jacobian",
)
