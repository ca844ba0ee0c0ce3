"""The rate of the whole robot's momentum about its centre of mass."""

from __future__ import annotations

from psdmc.dynamics.momentum_and_energy import about_centre, total_momentum_rate
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import QD, QDD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q, QD, QDD)
RATE = Quantity(
    "hdot",
    ("6",),
    means="rate of the linear momentum (N), then of the angular momentum about the centre of mass (N m), along the axes of "
    "the base frame; drive inertias (motors and gears) are not included",
    unit="J",
    powers=(-1,),
)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar], qdd: list[Scalar]) -> Outputs:
    bodies = robot.solids()
    parts = about_centre(robot.frames, bodies, q, total_momentum_rate(robot.frames, bodies, q, qd, qdd))
    return {"hdot": [x for part in parts for x in robot.in_base(part)]}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    states = (given[name] for name in ("q", "qd", "qdd"))
    return {"hdot": robot.each(lambda *at: pin.computeCentroidalMomentumTimeVariation(*at).vector, *states)}


RECIPE = Recipe(
    Signature(
        "centroidal_momentum_rate",
        424,
        "rate of the linear momentum (N), then of the angular momentum about the centre of mass (N m) of all links, along "
        "the base frame's axes: the sum of all external forces, gravity's included, and of their moments",
        INPUTS,
        (RATE,),
        theta=False,
        summary="Compute the time derivative of the centroidal momentum. The centroidal momentum is the linear "
        "momentum of all links, then their angular momentum about their centre of mass.",
    ),
    "rate of the centroidal momentum",
    *on_both(values, INPUTS),
    "computeCentroidalMomentumTimeVariation",
    pinocchio,
    needs=Needs.STANDARD,
    beside="centroidal_momentum_matrix",
)
