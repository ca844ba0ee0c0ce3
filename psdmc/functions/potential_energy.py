"""The potential energy in gravity, which is zero at q = 0. Torques do not determine its constant."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.momentum_and_energy import potential_energy
from psdmc.program.signature import Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference
from psdmc.robot.mechanism import Array


def trace(g: Ingredients) -> Outputs:
    return {"U": potential_energy(g.frames, g.bodies, g.inputs["q"], g.base_acceleration)}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q = given["q"]
    return {
        "U": entries(potential_energy(robot.frames, robot.bodies, list(q.T), robot.base_acceleration), len(q))
    }


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return Pinocchio's potential energy minus its value at q = 0."""
    import pinocchio as pin

    def energy(model: Any, data: Any, q: Array) -> Array:
        at_zero = pin.computePotentialEnergy(model, data, pin.neutral(model))
        return np.asarray(pin.computePotentialEnergy(model, data, q) - at_zero)

    return {"U": robot.each(energy, given["q"])}


RECIPE = Recipe(
    Signature(
        "potential_energy",
        140,
        "potential energy U(q) (J), zero at q = 0; dU/dq = g(q)",
        (Q,),
        (Quantity("U", means="potential energy, J; zero at q = neutral()", unit="J"),),
        theta=True,
        weighs=True,
        summary="Compute the potential energy U(q) of the links in the gravity field. Its derivatives by q are "
        "the gravity torques g(q).",
    ),
    "potential energy",
    trace,
    reference,
    "computePotentialEnergy",
    pinocchio,
    shares="inverse_dynamics",
    matters=(),
    beside="kinetic_energy",
)
