"""The torques' regressor in theta_b."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, Q, Quantity, Signature
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
from psdmc.recipes.torques_and_accelerations import rows_on_arrays, traced_rows


def trace(g: Ingredients) -> Outputs:
    return {"Y": traced_rows(g, g.inputs["qdd"])}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return {"Y": rows_on_arrays(robot, given["q"], given["qd"], given["qdd"])}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"Y": robot.inverse_dynamics(given["q"], given["qd"], given["qdd"])}


RECIPE = Recipe(
    Signature(
        "regressor",
        70,
        "regressor Y(q, qd, qdd): tau = Y theta_b",
        (Q, QD, QDD),
        (
            Quantity(
                "Y",
                ("nv", "l"),
                means="regressor: row i is for tau[i], column j for theta_b[j]; SI units",
                unit="J",
                powers=(-1, -1),
            ),
        ),
        theta=False,
        weighs=True,
        summary="Compute the regressor Y(q, qd, qdd), with which the torques of inverse dynamics are tau = Y "
        "theta_b. The base parameters theta_b are combinations of masses and inertias.",
    ),
    "joint-torque regressor",
    trace,
    reference,
    "rnea",
    pinocchio,
    polynomials=Polynomials.REGRESSOR,
    times_theta=True,
    in_limbs=True,
    default=True,
    benched=True,
)
