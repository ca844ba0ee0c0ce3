"""Derivatives of the velocity of the whole robot's centre of mass by joint positions and rates."""

from __future__ import annotations

from psdmc.dynamics.momentum_and_energy import momentum_rate_slopes
from psdmc.dynamics.scalar import Scalar
from psdmc.functions import centroidal_momentum_derivatives
from psdmc.functions.com_velocity import INPUTS, VELOCITY
from psdmc.program.signature import Signature, derivative_of
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    """Differentiate the acceleration at rest, J qdd, at qdd = qd: there it equals the velocity."""
    found = momentum_rate_slopes(robot.frames, robot.solids(), q, [0.0] * len(qd), qd)
    by_q, by_qd = (robot.rows_in_base(rows[:3], 1.0 / robot.mass) for rows in (found.by_q, found.by_qdd))
    return {"dv_dq": by_q, "dv_dqd": by_qd}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Divide Pinocchio's derivatives of the momentum by the mass. Its getCenterOfMassVelocityDerivatives divides by the
    masses of subtrees, and returns NaN if a last link has none."""
    found = centroidal_momentum_derivatives.RECIPE.pinocchio(robot, given)
    mass = sum(inertia.mass for inertia in list(robot.model.inertias)[1:])
    return {"dv_dq": found["dh_dq"][:, :3] / mass, "dv_dqd": found["dh_dqd"][:, :3] / mass}


RECIPE = Recipe(
    Signature(
        "com_velocity_derivatives",
        412,
        "derivatives by q and qd of the velocity of all links' common centre of mass, base frame; those by qd are its "
        "Jacobian",
        INPUTS,
        tuple(derivative_of(VELOCITY, quantity) for quantity in INPUTS),
        theta=False,
        summary="Compute the derivatives by q and qd of the velocity v of the centre of mass of all links. v is "
        "along the axes of the base frame.",
    ),
    "derivatives of the centre of mass's velocity",
    *on_both(values, INPUTS),
    "computeCentroidalDynamicsDerivatives",
    pinocchio,
    needs=Needs.STANDARD,
    beside="com_jacobian",
)
