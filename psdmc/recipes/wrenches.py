"""External wrenches at the named frames: as inputs, and what derivatives by them are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psdmc.dynamics.kinematics import link_wrenches, local_jacobians
from psdmc.dynamics.newton_euler import Wrench
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.program.signature import Quantity
from psdmc.recipes.directions import along, direction_of
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Given, Ingredients, Reference
from psdmc.reproducible import times
from psdmc.robot.mechanism import Array, NamedFrame

WRENCHES = Quantity(
    "wrenches",
    ("frames", "6"),
    largest=20.0,
    means="wrench that the world exerts on each named frame: force (N), then moment (N m) about the frame's origin, "
    "along the axes of the frame",
    unit="J",
    powers=(0, -1),
)

DWRENCHES = direction_of(WRENCHES)

GRADIENT_WRENCHES = Quantity(
    "grad_wrenches",
    WRENCHES.axes,
    means="gradient of the weighted sum by wrenches: entry [k, m] is the derivative by wrenches[k, m]",
    unit="1",
    powers=(0, 1),
)


def wrenches_on_links(g: Ingredients) -> dict[int, Wrench]:
    """Convert the input `wrenches` to the joint frames that carry the named frames."""
    return on_joint_frames(g.named, g.inputs[WRENCHES.name])


def wrenches_on_arrays(robot: RobotOnArrays, given: Given) -> dict[int, Wrench]:
    """Convert given arrays likewise."""
    values = given[WRENCHES.name]
    return on_joint_frames(robot.chain.frames, list(values.reshape(len(values), -1).T))


def on_joint_frames(named: Sequence[NamedFrame], values: Sequence[Scalar]) -> dict[int, Wrench]:
    """Convert wrenches at the named frames, 6 values each in one list, to the joint frames that carry them."""
    return link_wrenches(named, [values[6 * k : 6 * k + 6] for k in range(len(named))])


def jacobians_on_arrays(robot: RobotOnArrays, given: Given) -> Array:
    """Compute the torques (k, nv, frames, 6) of unit wrenches: the transposed Jacobians along the named frames' axes."""
    q = given["q"]
    found = entries(local_jacobians(robot.frames, robot.chain.frames, list(q.T)), len(q))
    return np.moveaxis(found, -1, 1)


def jacobians_transposed(g: Ingredients) -> list[list[list[Scalar]]]:
    """Compute the same in a trace: a list of nv lists, each with six values per named frame."""
    found = local_jacobians(g.frames, g.named, g.inputs["q"])
    return [[[row[k] for row in rows] for rows in found] for k in range(len(g.inputs["qd"]))]


def loads(g: Ingredients, jacobians: Sequence[Sequence[Sequence[Scalar]]]) -> list[Scalar]:
    """Return the nv torques of the input `wrenches`, from `jacobians_transposed`."""
    values = g.inputs[WRENCHES.name]
    return [inner_product([x for row in rows for x in row], values) for rows in jacobians]


def times_wrenches(matrices: Array, wrenches: Array) -> Array:
    """Multiply matrices (k, nv, frames, 6) by wrenches; the products are (k, nv)."""
    count, nv = matrices.shape[:2]
    return along(matrices.reshape(count, nv, -1), wrenches.reshape(count, -1))


def along_all(blocks: Arrays, directions: Sequence[Quantity], given: Given) -> Array:
    """Sum the derivatives by all inputs times their directions, (k, nv). The wrenches are the last input."""
    *others, last = zip(blocks.values(), (given[direction.name] for direction in directions), strict=True)
    total = times_wrenches(*last)
    for block, direction in others:
        total = total + along(block, direction)
    return total


def torque_derivatives(robot: Reference, given: Given) -> list[Array]:
    """Return Pinocchio's derivatives of torques under wrenches by q, qd, qdd and wrenches."""
    states = (given[name] for name in ("q", "qd", "qdd", WRENCHES.name))
    jacobians = robot.local_frame_jacobians(given["q"])
    return [*robot.inverse_dynamics_derivatives(*states), -np.moveaxis(jacobians, -1, 1)]


def acceleration_derivatives(robot: Reference, given: Given) -> list[Array]:
    """Return Pinocchio's accelerations under wrenches and their derivatives by q, qd, tau and wrenches."""
    states = (given[name] for name in ("q", "qd", "tau", WRENCHES.name))
    *blocks, by_tau = robot.forward_dynamics_derivatives(*states)
    jacobians = robot.local_frame_jacobians(given["q"])
    transposed = np.moveaxis(jacobians, -1, 1).reshape(*by_tau.shape[:2], -1)
    by_wrenches = times(by_tau, transposed).reshape(*by_tau.shape[:2], *jacobians.shape[1:3])
    return [*blocks, by_tau, by_wrenches]
