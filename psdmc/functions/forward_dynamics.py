"""Forward dynamics: accelerations from torques, by a factorized mass matrix or by the articulated-body algorithm."""

from __future__ import annotations

from psdmc.program.signature import QD, QDD, TAU, Q, Signature
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
from psdmc.recipes.torques_and_accelerations import MASS_MATRIX, accelerations_and_pivots


def trace(g: Ingredients) -> Outputs:
    qdd, pivots = accelerations_and_pivots(g, g.inputs["tau"])
    return {"qdd": list(qdd), "pivot": list(pivots)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    """Return the accelerations from which the tests computed the torques. They are exact, whereas a solution with the
    mass matrix loses digits if the matrix is badly conditioned."""
    return {"qdd": given["qdd"]}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"qdd": robot.forward_dynamics(given["q"], given["qd"], given["tau"])}


RECIPE = Recipe(
    Signature(
        "forward_dynamics",
        20,
        "joint accelerations that torques cause, qdd = M(q)^-1 (tau - h(q, qd))",
        (Q, QD, TAU),
        (QDD,),
        theta=True,
        summary="Compute the joint accelerations that torques cause: qdd = M(q)^-1 (tau - h(q, qd)). M is the mass "
        "matrix, h the sum of the Coriolis, centrifugal and gravity torques.",
        factorises=(MASS_MATRIX,),
        spoilt="accelerations",
    ),
    "forward dynamics",
    trace,
    reference,
    "aba",
    pinocchio,
    starts="inverse_dynamics",
    polynomials=Polynomials.SOLVED,
    in_limbs=True,
    accelerates=True,
    default=True,
    benched=True,
)
