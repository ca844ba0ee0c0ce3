"""Forward dynamics with external wrenches and its derivative along a direction (forward mode)."""

from __future__ import annotations

from psdmc.functions import forward_dynamics_with_wrenches, forward_dynamics_with_wrenches_derivatives
from psdmc.program.signature import QDD, Signature
from psdmc.recipes.directions import DQ, DQD, DTAU, along_direction, torque_slopes
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference, RobotOnArrays
from psdmc.recipes.torques_and_accelerations import accelerations
from psdmc.recipes.wrenches import DWRENCHES, WRENCHES, along_all, wrenches_on_links

ACCELERATIONS = forward_dynamics_with_wrenches.RECIPE
BLOCKS = forward_dynamics_with_wrenches_derivatives.RECIPE
DIRECTIONS = (DQ, DQD, DTAU, DWRENCHES)


def trace(g: Ingredients) -> Outputs:
    """Trace as `forward_dynamics_jvp` does. The torques of inverse dynamics depend on the wrenches, too."""
    external, wrenches = wrenches_on_links(g), [g.inputs[each.name] for each in (WRENCHES, DWRENCHES)]
    qdd, factors = accelerations(g, g.inputs["tau"], external)
    changes = torque_slopes(g, qdd, external, *wrenches)
    load = [given - own for given, own in zip(g.inputs[DTAU.name], changes, strict=True)]
    return {"qdd": qdd, "dqdd": factors.solved(load), "pivot": factors.pivots}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    return _along(BLOCKS.reference(robot, given), given)


def pinocchio(robot: Reference, given: Given) -> Arrays:
    return _along(BLOCKS.pinocchio(robot, given), given)


def _along(found: Arrays, given: Given) -> Arrays:
    qdd = found.pop("qdd")
    return {"qdd": qdd, "dqdd": along_all(found, DIRECTIONS, given)}


RECIPE = Recipe(
    Signature(
        "forward_dynamics_with_wrenches_jvp",
        436,
        "qdd under external wrenches, and its derivative along (dq, dqd, dtau, dwrenches)",
        (*ACCELERATIONS.signature.inputs, *DIRECTIONS),
        (*ACCELERATIONS.signature.outputs, along_direction(QDD)),
        theta=True,
        summary="Compute the accelerations qdd that torques cause under external wrenches. Also compute dqdd, the "
        "derivative of qdd along a direction (dq, dqd, dtau, dwrenches). If each input changes by e times its "
        "part of the direction, with a small number e, qdd changes by about e dqdd.",
        factorises=ACCELERATIONS.signature.factorises,
    ),
    "forward dynamics with wrenches along a direction",
    trace,
    reference,
    "computeABADerivatives with fext",
    pinocchio,
    shares="inverse_dynamics",
)
