"""Kinetic energy."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.momentum_and_energy import kinetic_energy
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Outputs, Recipe, Reference
from psdmc.robot.mechanism import Array


def trace(g: Ingredients) -> Outputs:
    return {"T": kinetic_energy(g.frames, g.bodies, g.drives, g.inputs["q"], g.inputs["qd"])}


def reference(robot: RobotOnArrays, given: Given) -> Arrays:
    q, qd = given["q"], given["qd"]
    return {
        "T": entries(kinetic_energy(robot.frames, robot.bodies, robot.drives, list(q.T), list(qd.T)), len(q))
    }


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return Pinocchio's kinetic energy of the links plus that of the drives. Pinocchio 4.1 leaves out the armature of
    joints about oblique axes in the energy, but not in the mass matrix."""
    import pinocchio as pin

    links = pin.Model(robot.model)
    links.armature = np.zeros(links.nv)
    own = links.createData()

    def energy(model: Any, data: Any, q: Array, qd: Array) -> Array:
        return np.asarray(pin.computeKineticEnergy(links, own, q, qd) + 0.5 * qd**2 @ model.armature)

    return {"T": robot.each(energy, given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "kinetic_energy",
        130,
        "kinetic energy T = qd^T M(q) qd / 2 (J), drive inertias included",
        (Q, QD),
        (Quantity("T", means="kinetic energy, J", unit="J"),),
        theta=True,
        summary="Compute the kinetic energy T = qd^T M(q) qd / 2 of the links and the drives (motors and "
        "gears).",
    ),
    "kinetic energy",
    trace,
    reference,
    "computeKineticEnergy",
    pinocchio,
    shares="inverse_dynamics",
    matters=(),
)
