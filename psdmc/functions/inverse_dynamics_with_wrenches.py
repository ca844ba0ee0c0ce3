"""Inverse dynamics with external wrenches at the named frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.dynamics.named_frames import link_wrenches
from psdmc.program.signature import QD, QDD, TAU, Q, Quantity, Signature
from psdmc.recipes.on_arrays import RobotOnArrays
from psdmc.recipes.recipe import Arrays, Ingredients, Outputs, Recipe
from psdmc.recipes.torques import torques
from psdmc.robot.mechanism import Array

if TYPE_CHECKING:
    from psdmc.robot.reference import Reference

WRENCHES = Quantity(
    "wrenches",
    ("frames", "6"),
    largest=20.0,
    means="what the world exerts on each named frame: force (N), then moment (N m) about the frame's origin, "
    "along the axes of the frame",
    unit="J",
    powers=(0, -1),
)


def trace(g: Ingredients) -> Outputs:
    rows = [g.inputs["wrenches"][6 * k : 6 * k + 6] for k in range(len(g.named))]
    external = link_wrenches(g.named, rows)
    return {"tau": torques(g, g.inputs["qd"], g.inputs["qdd"], g.base_acceleration, external=external)}


def reference(robot: RobotOnArrays, given: Mapping[str, Array]) -> Arrays:
    named = robot.chain.frames
    wrenches = given["wrenches"].reshape(-1, len(named), 6)
    external = link_wrenches(named, [list(wrenches[:, k].T) for k in range(len(named))])
    return {
        "tau": robot.torques(
            given["q"], given["qd"], given["qdd"], robot.base_acceleration, external=external
        )
    }


def pinocchio(robot: Reference, given: Mapping[str, Array]) -> Arrays:
    """Compute torques by Pinocchio, for tests. The given wrenches are moved from the named frames to the joint frames,
    as Pinocchio's argument fext needs them."""
    import pinocchio as pin

    def loaded(model: Any, data: Any, q: Array, qd: Array, qdd: Array, wrenches: Array) -> Array:
        forces = [pin.Force.Zero() for _ in range(model.njoints)]
        for number, wrench in zip(robot.frame_ids, wrenches.reshape(-1, 6), strict=True):
            frame = model.frames[number]
            forces[frame.parentJoint] += frame.placement.act(pin.Force(wrench))
        found: Array = pin.rnea(model, data, q, qd, qdd, forces)
        return found

    wrenches = np.reshape(given["wrenches"], (len(given["q"]), -1))
    return {"tau": robot.each(loaded, given["q"], given["qd"], given["qdd"], wrenches)}


RECIPE = Recipe(
    Signature(
        "inverse_dynamics_with_wrenches",
        160,
        "tau = M(q) qdd + h(q, qd) - sum of J^T wrench; a wrench is the force (N), then the moment (N m) about the "
        "frame's origin, that the world exerts on a named frame, along that frame's own axes",
        (Q, QD, QDD, WRENCHES),
        (TAU,),
        theta=True,
        summary="Compute the joint torques of a motion under external wrenches: M(q) qdd + h(q, qd), minus J^T wrench "
        "for each named frame.",
    ),
    "inverse dynamics with wrenches",
    trace,
    reference,
    "rnea with fext",
    pinocchio,
    shares="inverse_dynamics",
)
