"""The gravity torques and their derivatives by joint positions."""

from __future__ import annotations

import numpy as np

from psdmc.dynamics.derivatives import inverse_dynamics_derivatives
from psdmc.functions.gravity import G
from psdmc.program.signature import Q, Signature, jacobian_of
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays


def trace(g: Ingredients) -> Outputs:
    """Compute the gravity torques and their derivatives by joint positions. If all joints have one coordinate, d g / d
    q is symmetric, and only one triangle is computed. With joints of several coordinates the matrix is not symmetric,
    because rotations do not commute."""
    still = g.still
    found = inverse_dynamics_derivatives(
        g.frames, g.bodies, g.drives, g.inputs["q"], still, still, g.base_acceleration, g.choices
    )
    if not all(frame.joint.about_z for frame in g.frames):
        return {"g": found.gravity, "dg_dq": found.by_q}
    n = len(still)
    slopes = [[found.by_q[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
    return {"g": found.gravity, "dg_dq": slopes}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    rest = np.zeros_like(given["qd"])
    by_q, _, _ = robot.torque_derivatives(given["q"], rest, rest)
    return {"g": robot.torques(given["q"], rest, rest, robot.base_acceleration), "dg_dq": by_q}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    slopes = robot.each(pin.computeGeneralizedGravityDerivatives, given["q"])
    return {"g": robot.gravity(given["q"]), "dg_dq": slopes}


RECIPE = Recipe(
    Signature(
        "gravity_derivatives",
        194,
        "gravity torques g(q), and d g / d q; row i: derivatives of g[i]",
        (Q,),
        (
            G,
            jacobian_of("g", "q"),
        ),
        theta=True,
        weighs=True,
        summary="Compute the gravity torques g(q). Also compute the derivatives of g by q.",
    ),
    "derivatives of gravity",
    trace,
    reference,
    "computeGeneralizedGravityDerivatives",
    pinocchio,
    shares="inverse_dynamics",
    in_limbs=True,
    beside="inverse_dynamics",
)
