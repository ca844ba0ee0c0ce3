"""Derivatives of the named frames' velocities by joint positions."""

from __future__ import annotations

from typing import Any

import numpy as np

from psdmc.dynamics.kinematics import frame_velocity_slopes
from psdmc.dynamics.scalar import Scalar
from psdmc.program.signature import QD, Q, Quantity, Signature
from psdmc.recipes.recipe import Arrays, Given, Outputs, PlacedRobot, Recipe, Reference, on_both
from psdmc.robot.mechanism import Array

INPUTS = (Q, QD)


def values(robot: PlacedRobot, q: list[Scalar], qd: list[Scalar]) -> Outputs:
    return {"dv_dq": frame_velocity_slopes(robot.frames, robot.named, q, qd, robot.root)}


def pinocchio(robot: Reference, given: Given) -> Arrays:
    """Return Pinocchio's derivatives of the frames' velocities, along the base's axes. Pinocchio's derivatives along
    the frame's axes are rotated. The derivative of this rotation, times the velocity, is added."""
    import pinocchio as pin

    def slopes(model: Any, data: Any, q: Array, qd: Array) -> Array:
        pin.computeForwardKinematicsDerivatives(model, data, q, qd, np.zeros(model.nv))
        found = []
        for frame in robot.frame_ids:
            rotation = pin.updateFramePlacement(model, data, frame).rotation
            local = pin.getFrameVelocityDerivatives(model, data, frame, pin.LOCAL)
            by_q, columns = (np.einsum("ij,kjl->kil", rotation, np.reshape(x, (2, 3, -1))) for x in local)
            turned = np.cross(columns[1].T[None], (columns @ qd)[:, None]).transpose(0, 2, 1)
            found.append((by_q + turned).reshape(6, -1))
        return np.array(found)

    return {"dv_dq": robot.each(slopes, given["q"], given["qd"])}


RECIPE = Recipe(
    Signature(
        "frame_velocity_derivatives",
        196,
        "d (J qd) / d q: derivatives of every named frame's linear then angular velocity, base frame; those by qd are J",
        INPUTS,
        (
            Quantity(
                "dv_dq",
                ("frames", "6", "nv"),
                means="derivatives of v by q: entry [k, i, j] is the derivative of v[k, i] by q[j]",
                unit="1/s",
                powers=(0, 1, -1),
                by_q=True,
            ),
        ),
        theta=False,
        summary="Compute the derivatives by q of the velocity v of each named frame. v has three linear entries "
        "(of the frame's origin), then three angular ones, along the axes of the base frame.",
    ),
    "derivatives of frame velocities",
    *on_both(values, INPUTS),
    "getFrameVelocityDerivatives",
    pinocchio,
    beside="frame_jacobian",
)
