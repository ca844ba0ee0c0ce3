"""Derivatives of the named frames' accelerations by joint positions, rates and accelerations."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.kinematics import frame_acceleration_slopes
from psdmc.dynamics.scalar import Scalar
from psdmc.functions.frame_acceleration import ACCELERATION, INPUTS
from psdmc.program.signature import Signature, derivative_of
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

OUTPUTS = tuple(derivative_of(ACCELERATION, quantity) for quantity in INPUTS)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar], qdd: list[Scalar]) -> Outputs:
    found = frame_acceleration_slopes(robot.frames, robot.named, q, qd, qdd, robot.root)
    return {"da_dq": found.by_q, "da_dqd": found.by_qd, "da_dqdd": found.by_qdd}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Convert Pinocchio's derivatives of the spatial acceleration along the frame's own axes to those of the acceleration
    of the frame's origin along the base's axes."""
    import pinocchio as pin

    def slopes(model: Any, data: Any, q: Array, qd: Array, qdd: Array) -> Array:
        pin.computeForwardKinematicsDerivatives(model, data, q, qd, qdd)
        return np.array([of_frame(model, data, frame) for frame in robot.frame_ids])

    def of_frame(model: Any, data: Any, frame: int) -> Array:
        rotation = pin.updateFramePlacement(model, data, frame).rotation
        v = pin.getFrameVelocity(model, data, frame, pin.LOCAL)
        a = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL)
        found = pin.getFrameAccelerationDerivatives(model, data, frame, pin.LOCAL)
        dv_dq, *by, columns = (np.reshape(x, (2, 3, -1)) for x in found)
        blocks = []
        for da, dv in zip((*by, columns), (dv_dq, columns, 0.0 * columns), strict=True):
            bent = np.cross(dv[1].T, v.linear).T + np.cross(v.angular, dv[0].T).T
            blocks.append(np.stack([da[0] + bent, da[1]]))
        turned = np.cross(columns[1].T, np.stack([a.linear, a.angular])[:, None]).transpose(0, 2, 1)
        blocks[0] = blocks[0] + turned
        return np.reshape(np.einsum("ij,bpjl->bpil", rotation, np.stack(blocks)), (3, 6, -1))

    found = robot.each(slopes, given["q"], given["qd"], given["qdd"])
    return {quantity.name: found[:, :, k] for k, quantity in enumerate(OUTPUTS)}


RECIPE = Recipe(
    Signature(
        "frame_acceleration_derivatives",
        404,
        "derivatives of every named frame's linear then angular acceleration by q, qd and qdd, base frame; those by qdd "
        "are J",
        INPUTS,
        OUTPUTS,
        theta=False,
        summary="Compute the derivatives by q, qd and qdd of the acceleration a of each named frame. a has three "
        "linear entries (of the frame's origin), then three angular ones, along the axes of the base frame.",
    ),
    "derivatives of frame accelerations",
    *on_both(values, INPUTS),
    "getFrameAccelerationDerivatives",
    pinocchio,
    beside="frame_jacobian",
)
