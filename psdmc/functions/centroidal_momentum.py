"""The whole robot's momentum about its centre of mass."""

from __future__ import annotations

from psdmc.dynamics.momentum_and_energy import about_centre, total_momentum
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Needs, Outputs, PlacedRobot, Recipe, Reference, on_both

INPUTS = (Q, QD)
MOMENTUM = Quantity(
    "h",
    ("6",),
    means="linear momentum (kg m/s), then angular momentum about the centre of mass (kg m^2/s), along the axes of the base "
    "frame; drive inertias (motors and gears) are not included",
    unit="J s",
    powers=(-1,),
)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    bodies = robot.solids()
    parts = about_centre(robot.frames, bodies, q, total_momentum(robot.frames, bodies, q, qd))
    return {"h": [x for part in parts for x in robot.in_base(part)]}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    import pinocchio as pin

    found = robot.each(lambda *at: pin.computeCentroidalMomentum(*at).vector, given["q"], given["qd"])
    return {"h": found}


RECIPE = Recipe(
    Signature(
        "centroidal_momentum",
        420,
        "linear momentum (kg m/s), then angular momentum about the centre of mass (kg m^2/s) of all links, along the base "
        "frame's axes, drive inertias not included",
        INPUTS,
        (MOMENTUM,),
        theta=False,
        summary="Compute the linear momentum of all links, and their angular momentum about their centre of mass.",
    ),
    "centroidal momentum",
    *on_both(values, INPUTS),
    "computeCentroidalMomentum",
    pinocchio,
    needs=Needs.STANDARD,
    beside="centroidal_momentum_matrix",
)
