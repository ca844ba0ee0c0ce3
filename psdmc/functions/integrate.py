"""The position that a robot reaches from a given position at constant rates."""

from __future__ import annotations

from psdmc.dynamics.manifold import integrated
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.recipes.steps import Q_NEXT

WAY = Quantity(
    "v",
    ("nv",),
    3.0,
    means="displacement of the joints, rad or m. For a ball joint, it is a rotation vector (rad) along the axes of the "
    "body. For a floating base, it is the constant linear and angular velocity along the base's own axes, times a time",
    unit="1",
    powers=(1,),
)
"""Rates times seconds: rad or m."""


INPUTS = (Q, WAY)


def values(robot: PlacedRobot, q: list[Scalar], way: list[Scalar]) -> Outputs:
    return {"q_next": integrated(robot.frames, q, way)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return {"q_next": robot.integrated(given["q"], given[WAY.name])}


RECIPE = Recipe(
    Signature(
        "integrate",
        222,
        "q after v, which are rates times seconds: q + v where joints have one coordinate; quaternions turned by v about "
        "their own axes and made unit ones, also where those of q are not",
        INPUTS,
        (Q_NEXT,),
        theta=False,
        summary="Compute the joint positions q_next after a displacement v of the joints from q. For example, v "
        "is a joint rate times a time.",
        normalizes=True,
    ),
    "position after constant rates",
    *on_both(values, INPUTS),
    "integrate",
    pinocchio,
    matters=(),
    default_where_wide=True,
)
