"""Merges the inertias of URDF links that move together, and compares them with Pinocchio's result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from psdmc.errors import InputError
from psdmc.reproducible import times
from psdmc.robot.inertia import inertia_matrix, six_of, standard_parameters, without_noise
from psdmc.robot.joints import REVOLUTE
from psdmc.robot.load_options import TOOL
from psdmc.robot.mechanism import Array, NamedFrame, Placement
from psdmc.robot.pinocchio_text import JOINT_PREFIX, locked_at, pinocchio_model
from psdmc.robot.rotation import from_quaternion, roll_pitch_yaw
from psdmc.robot.snap import snap_rotation
from psdmc.robot.tree import Route
from psdmc.robot.urdf import LOCKABLE, Origin, UrdfInertial, UrdfJoint, UrdfRobot

AGREEMENT = 1e-11
"""Allowed difference relative to the largest parameter of the body's mass, moments or inertias: rounding of angles up
to 1e3 rad leaves 1e-13, another reading of a number far more."""


def placement_of(origin: Origin, snap: float = 0.0) -> Placement:
    """Return the placement that an <origin> element states. The rotations about the three axes are snapped one by one:
    near right angles become exact (`snap` in rad)."""
    if origin.quaternion is None:
        return Placement(roll_pitch_yaw(origin.rpy, snap), np.array(origin.xyz))
    return Placement(snap_rotation(from_quaternion(*origin.quaternion), snap)[0], np.array(origin.xyz))


def place_of(joint: UrdfJoint, snap: float = 0.0) -> Placement:
    """Return the placement of a joint's child link at q = 0, or at the locked position of the joint. Rotations are
    snapped: near right angles become exact (`snap` in rad)."""
    place = placement_of(joint.origin, snap)
    if joint.held is None:
        return place
    return place @ Placement(snap_rotation(joint.held.rotation, snap)[0], joint.held.translation)


def merged_parameters(robot: UrdfRobot, route: Route) -> list[Array]:
    """Return ten standard parameters for each movable joint, about the frame of the joint's child link. The parameters
    are those of all links that move with the joint.

    Joints that are not among the selected ones are locked at their neutral position.
    """
    return [without_noise(_merged(robot, body)) for body in bodies_of(robot, route.movable)]


def bodies_of(robot: UrdfRobot, movable: Sequence[UrdfJoint]) -> list[dict[str, Placement]]:
    """Return for each movable joint the links that it moves together, up to the next movable joints. A link has the
    placement in the frame of the joint's child link, which comes first."""
    below: dict[str, list[tuple[str, Placement]]] = {}
    moves = {joint.name for joint in movable}
    for joint in robot.joints:
        if joint.name not in moves:
            below.setdefault(joint.parent, []).append((joint.child, place_of(joint)))
    return [_with_all_below(joint.child, below) for joint in movable]


def body_parameters(body: UrdfInertial | None, place: Placement) -> Array:
    """Return a link's standard parameters (10,) about a frame in which it has the placement `place`."""
    if body is None:
        return np.zeros(10)
    at = place @ placement_of(body.origin)
    turned = times(times(at.rotation, inertia_matrix(np.array(body.inertia))), at.rotation.T)
    return standard_parameters(body.mass, at.translation, six_of(turned))


def hold_against_pinocchio(
    robot: UrdfRobot,
    route: Route,
    merged: Sequence[Array],
    text: str,
    source: str,
    held: Mapping[str, float],
) -> None:
    """Raise InputError with the name of the first link whose inertia Pinocchio reads or merges differently.

    First each link is compared alone, in a model where every joint is revolute, so that no links are merged. Then the
    merged inertias are compared. `held` are the positions of joints that are locked at another position than the
    neutral one.
    """
    free = robot.free_root
    alone = pinocchio_model(text, source, kinds=dict.fromkeys(LOCKABLE, REVOLUTE.word), free_root=free)
    for joint in robot.joints:
        own = body_parameters(robot.inertials[joint.child], Placement.identity())
        _compare(
            own, alone.inertias[alone.getJointId(JOINT_PREFIX + joint.name)], joint.child, "the body", source
        )
    movable = [joint.name for joint in route.movable]
    whole = locked_at(pinocchio_model(text, source, [*movable, *held], free_root=free), held)
    for joint, own in zip(route.movable, merged, strict=True):
        body = whole.inertias[whole.getJointId(JOINT_PREFIX + joint.name)]
        _compare(own, body, joint.child, "all that moves with it", source)


def _with_all_below(link: str, below: dict[str, list[tuple[str, Placement]]]) -> dict[str, Placement]:
    """The link and all links that hang on it, each with its place in the link's frame."""
    places: dict[str, Placement] = {}
    queue = [(link, Placement.identity())]
    while queue:
        name, place = queue.pop()
        places[name] = place
        queue += [(child, place @ origin) for child, origin in reversed(below.get(name, []))]
    return places


def _merged(robot: UrdfRobot, body: Mapping[str, Placement]) -> Array:
    """(10,) standard parameters of links together."""
    total = np.zeros(10)
    for name, place in body.items():
        total = total + body_parameters(robot.inertials[name], place)
    return total


def _compare(own: Array, other: object, link: str, what: str, source: str) -> None:
    found = np.array(other.toDynamicParameters())  # type: ignore[attr-defined]
    for group in (slice(0, 1), slice(1, 4), slice(4, 10)):
        size = max(float(np.abs(own[group]).max()), float(np.abs(found[group]).max()))
        if not np.all(np.abs(own[group] - found[group]) <= AGREEMENT * size):
            values = f"{_listed(own[group])} and {_listed(found[group])}"
            raise InputError(
                f"{source}: link '{link}': psdmc and Pinocchio read {what} differently: {values}",
                "write its numbers as plain decimals, and report the file: one of the two readers is wrong",
            )


def _listed(values: Array) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def tool_frame(tip: NamedFrame, tool: Sequence[float]) -> NamedFrame:
    """Return the named frame 'tool', placed in the tip frame by x y z (m) and roll pitch yaw (rad)."""
    # Turns are about fixed axes x, y, z in turn, as in URDF.
    x, y, z, roll, pitch, yaw = tool
    return NamedFrame(
        TOOL, tip.joint, tip.placement @ placement_of(Origin(xyz=(x, y, z), rpy=(roll, pitch, yaw)))
    )
