"""Forward dynamics: accelerations from torques, by a factorized mass matrix."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from psdmc.dynamics.composite_body import mass_matrix
from psdmc.dynamics.solve import factorize, solve
from psdmc.program.signature import QD, QDD, TAU, Positive, Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Needs, Outputs, Polynomials, Recipe
from psdmc.recipes.torques import torques
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference


def trace(g: Ingredients) -> Outputs:
    """The mass matrix is factorized before the bias is found: its divisions wait for each other, the recursion fills
    the time."""
    factors = factorize(mass_matrix(g.frames, g.bodies, g.drives, g.inputs["q"], g.choices))
    bias = torques(g, g.inputs["qd"], g.still, g.base)
    load = [tau - h for tau, h in zip(g.inputs["tau"], bias, strict=True)]
    return {"qdd": solve(factors, load), "pivot": factors.pivots}


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    """The accelerations that the torques were computed from: exact, where a solution loses the condition number."""
    return {"qdd": given["qdd"]}


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    return {"qdd": robot.forward_dynamics(given["q"], given["qd"], given["tau"])}


RECIPE = Recipe(
    Signature(
        "forward_dynamics",
        20,
        "qdd = M(q)^-1 (tau - h(q, qd))",
        (Q, QD, TAU),
        (QDD,),
        theta=True,
        positive=Positive(
            Quantity("pivot", ("nv",)),
            which="the joint whose pivot is not positive",
            reason="the joint at which the mass matrix is not positive definite",
            spoilt="accelerations",
        ),
    ),
    "forward dynamics",
    trace,
    reference,
    "aba",
    pinocchio,
    starts="inverse_dynamics",
    polynomials=Polynomials.SOLVED,
    needs=Needs.POSITIVE_MASS,
    default=True,
    benched=True,
)
