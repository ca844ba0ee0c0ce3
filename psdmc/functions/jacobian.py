"""The geometric Jacobian of the tip frame (end effector), along the base's axes."""

from __future__ import annotations

from psdmc.dynamics.kinematics import jacobian
from psdmc.dynamics.scalar import dot
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, matrix
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference


def trace(g: Ingredients) -> Outputs:
    rows = jacobian(g.frames, g.tip_body, g.tip, g.inputs["q"])
    turned = [
        [dot(axes, (rows[k][j], rows[k + 1][j], rows[k + 2][j])) for j in range(len(g.still))]
        for k in (0, 3)
        for axes in g.base_axes
    ]
    return {"J": turned}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q = given["q"]
    return {"J": matrix(jacobian(robot.frames, robot.chain.tip_body, robot.chain.tip, list(q.T)), len(q))}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"J": robot.jacobian(given["q"])}


RECIPE = Recipe(
    Signature(
        "jacobian",
        90,
        "linear then angular velocity of the tip per unit joint rate, base frame",
        (Q,),
        (
            Quantity(
                "J",
                ("6", "nv"),
                means="three rows for the linear velocity of the frame's origin (m/s), three for the angular velocity "
                "(rad/s); column j is for qd[j]",
                unit="1",
                powers=(1, -1),
            ),
        ),
        theta=False,
        summary="Compute the Jacobian J of the tip frame (end effector): J qd is the tip's velocity along the "
        "axes of the base frame.",
    ),
    "Jacobian",
    trace,
    reference,
    "computeFrameJacobian",
    pinocchio,
    default=True,
)
