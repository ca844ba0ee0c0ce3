"""External wrenches at the named frames: as inputs, and what derivatives by them are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from psdmc.dynamics.named_frames import link_wrenches, local_jacobians
from psdmc.dynamics.newton_euler import Wrench
from psdmc.dynamics.scalar import Scalar
from psdmc.dynamics.solve import inner_product
from psdmc.program.signature import Quantity
from psdmc.recipes.directions import along
from psdmc.recipes.on_arrays import RobotOnArrays, entries
from psdmc.recipes.recipe import Arrays, Ingredients
from psdmc.robot.mechanism import Array, NamedFrame

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

DWRENCHES = replace(WRENCHES, name="dwrenches", largest=1.0, means="direction: change of wrenches")

GRADIENT_WRENCHES = Quantity(
    "grad_wrenches",
    WRENCHES.axes,
    means="gradient of the weighted sum by wrenches",
    unit="1",
    powers=(0, 1),
)


def wrenches_on_links(g: Ingredients) -> dict[int, Wrench]:
    """The inputs' wrenches about the joint frames that carry the named frames."""
    return _on_links(g.named, g.inputs[WRENCHES.name])


def wrenches_on_arrays(robot: RobotOnArrays, given: Mapping[str, Array]) -> dict[int, Wrench]:
    """Likewise of given arrays."""
    values = given[WRENCHES.name]
    return _on_links(robot.chain.frames, list(values.reshape(len(values), -1).T))


def _on_links(named: Sequence[NamedFrame], values: Sequence[Scalar]) -> dict[int, Wrench]:
    return link_wrenches(named, [values[6 * k : 6 * k + 6] for k in range(len(named))])


def jacobians_on_arrays(robot: RobotOnArrays, given: Mapping[str, Array]) -> Array:
    """(k, nv, frames, 6) torques that unit wrenches are worth: the Jacobians along the named frames' axes, transposed."""
    q = given["q"]
    found = entries(local_jacobians(robot.frames, robot.chain.frames, list(q.T)), len(q))
    return np.moveaxis(found, -1, 1)


def jacobians_transposed(g: Ingredients) -> list[list[list[Scalar]]]:
    """The same of a trace: nv of frames of six."""
    found = local_jacobians(g.frames, g.named, g.inputs["q"])
    return [[[row[k] for row in rows] for rows in found] for k in range(len(g.inputs["qd"]))]


def loads(g: Ingredients, jacobians: Sequence[Sequence[Sequence[Scalar]]]) -> list[Scalar]:
    """nv torques that the inputs' wrenches are worth, from `jacobians_transposed`."""
    values = g.inputs[WRENCHES.name]
    return [inner_product([x for row in rows for x in row], values) for rows in jacobians]


def times_wrenches(matrices: Array, wrenches: Array) -> Array:
    """(k, nv) matrices (k, nv, frames, 6) times wrenches."""
    count, nv = matrices.shape[:2]
    return along(matrices.reshape(count, nv, -1), wrenches.reshape(count, -1))


def along_all(blocks: Arrays, directions: Sequence[Quantity], given: Mapping[str, Array]) -> Array:
    """(k, nv) the sum of the derivatives by inputs times their directions, the wrenches' last."""
    *others, last = zip(blocks.values(), (given[direction.name] for direction in directions), strict=True)
    total = times_wrenches(*last)
    for block, direction in others:
        total = total + along(block, direction)
    return total


def each_under_wrenches(
    robot: Reference, function: Callable[..., Array], given: Mapping[str, Array], *names: str
) -> Array:
    """Values of a function of Pinocchio's (model, data, state ..., external forces) at every state."""

    def loaded(model: Any, data: Any, *state: Array) -> Array:
        *own, wrenches = state
        return function(model, data, *own, _on_joints(robot, wrenches))

    wrenches = np.reshape(given[WRENCHES.name], (len(given["q"]), -1))
    return robot.each(loaded, *(given[name] for name in names), wrenches)


def _on_joints(robot: Reference, wrenches: Array) -> list[Any]:
    """Each wrench of one state carried from its frame into the joint's, as Pinocchio's fext are given."""
    import pinocchio as pin

    model = robot.model
    forces = [pin.Force.Zero() for _ in range(model.njoints)]
    for number, wrench in zip(robot.frame_ids, wrenches.reshape(-1, 6), strict=True):
        frame = model.frames[number]
        forces[frame.parentJoint] += frame.placement.act(pin.Force(wrench))
    return forces


def torque_derivatives(robot: Reference, given: Mapping[str, Array]) -> list[Array]:
    """Pinocchio's derivatives of torques under wrenches by q, qd, qdd and wrenches."""
    from psdmc.robot import reference

    found = each_under_wrenches(robot, reference.torque_derivatives, given, "q", "qd", "qdd")
    jacobians = pinocchio_local_jacobians(robot, given["q"])
    return [*np.moveaxis(found, -3, 0), -np.moveaxis(jacobians, -1, 1)]


def acceleration_derivatives(robot: Reference, given: Mapping[str, Array]) -> list[Array]:
    """Pinocchio's derivatives of accelerations under wrenches by q, qd, tau and wrenches."""
    from psdmc.robot import reference

    found = each_under_wrenches(robot, reference.acceleration_derivatives, given, "q", "qd", "tau")
    by_q, by_qd, by_tau = np.moveaxis(found, -3, 0)
    jacobians = pinocchio_local_jacobians(robot, given["q"])
    return [by_q, by_qd, by_tau, np.einsum("kij,kfcj->kifc", by_tau, jacobians)]


def pinocchio_local_jacobians(robot: Reference, q: Array) -> Array:
    """(..., frames, 6, nv)"""
    import pinocchio as pin

    def jacobians(model: Any, data: Any, q: Array) -> Array:
        found = [pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL) for frame in robot.frame_ids]
        return np.reshape(found, (-1, 6, model.nv))

    return robot.each(jacobians, q)
