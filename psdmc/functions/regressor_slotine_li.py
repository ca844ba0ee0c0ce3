"""The regressor in theta_b that Slotine and Li's adaptive control law uses, with reference rates in addition to rates."""

from __future__ import annotations

import numpy as np

from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import rows_on_arrays, traced_rows


def trace(g: Ingredients) -> Outputs:
    return {"Y": traced_rows(g, g.inputs["qdd_r"], g.inputs["qd_r"])}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return {"Y": rows_on_arrays(robot, given["q"], given["qd"], given["qdd_r"], given["qd_r"])}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    turned = np.einsum("...ij,...j->...i", robot.mass_matrix(given["q"]), given["qdd_r"])
    coriolis = robot.coriolis_matrix(given["q"], given["qd"])
    carried = np.einsum("...ij,...j->...i", coriolis, given["qd_r"])
    return {"Y": turned + carried + robot.gravity(given["q"])}


RECIPE = Recipe(
    Signature(
        "regressor_slotine_li",
        80,
        "regressor Y of adaptive control (Slotine and Li): Y theta_b = M(q) qdd_r + C(q, qd) qd_r + g(q)",
        (
            Q,
            QD,
            Quantity(
                "qd_r",
                ("nv",),
                3.0,
                means="reference rates of the controller, rad/s or m/s",
                unit="1/s",
                powers=(1,),
            ),
            Quantity(
                "qdd_r",
                ("nv",),
                5.0,
                means="reference accelerations of the controller, rad/s^2 or m/s^2",
                unit="1/s^2",
                powers=(1,),
            ),
        ),
        (
            Quantity(
                "Y",
                ("nv", "l"),
                means="regressor: row i is for entry i of the torques, column j for theta_b[j]; SI units",
                unit="J",
                powers=(-1, -1),
            ),
        ),
        theta=False,
        weighs=True,
        summary="Compute the regressor Y of Slotine and Li's adaptive control (1987): Y theta_b = M(q) qdd_r + "
        "C(q, qd) qd_r + g(q). theta_b are the base parameters, M is the mass matrix, C the Coriolis matrix, and "
        "g the gravity torques.",
    ),
    "Slotine-Li regressor",
    trace,
    reference,
    "crba, computeCoriolisMatrix",
    pinocchio,
    times_theta=True,
    in_limbs=True,
    default=True,
)
