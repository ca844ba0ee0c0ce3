"""A whole URDF as data: every movable joint with its body, mimic joints as coordinates. Such trees are shown, not
derived."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.limits import MAX_JOINTS, shown
from psdmc.robot.load import load_robot, robot_text
from psdmc.robot.load_options import DEFAULT_SNAP
from psdmc.robot.mechanism import BASE, Joint, Mechanism, Placement
from psdmc.robot.snap import snap_axis
from psdmc.robot.urdf import MOVABLE, UrdfJoint, UrdfRobot, read_urdf
from psdmc.robot.urdf_bodies import merged_onto, placement_of
from psdmc.robot.urdf_chain import STANDARD_GRAVITY, link_rotation, merged_placement, movable_joint
from psdmc.robot.zeros import block_diagonal, link_span


def whole_robot(path: str | Path) -> Mechanism:
    """The whole content of a robot file: a URDF's tree, or the chain of a DH table. InputError names what is wrong."""
    file = Path(path)
    if file.suffix.lower() == ".toml":
        return load_robot(file).chain
    return urdf_mechanism(robot_text(file), file.name)


def urdf_mechanism(text: str, source: str, snap: float = DEFAULT_SNAP) -> Mechanism:
    """The URDF's tree from its root, joints in the order of Pinocchio's buildModelFromUrdf, fixed links merged.

    A mimic joint's coordinate is its leader's; one that follows a follower, the first leader's. The tip is the first
    leaf's link. InputError names joints that cannot be modelled, and followers that go round in a ring.
    """
    robot = read_urdf(text, source)
    ordered = list(_outward(robot, robot.root))
    movable = [joint for joint in ordered if joint.is_movable]
    _refuse_unsupported(movable, source)
    joints, parents = _placed(robot, ordered, snap)
    bodies = merged_onto(robot, movable)
    n = len(movable)
    tip = next(i for i in range(n) if i not in parents)
    return Mechanism(
        name=robot.name,
        convention="urdf",
        base_name=robot.root,
        tip_name=joints[tip].link_name,
        joints=tuple(joints),
        parameters=np.array([np.append(body, 0.0) for body in bodies]),
        parameter_span=block_diagonal([link_span(("Im",))] * n),
        gravity=np.array(STANDARD_GRAVITY),
        tip=joints[tip].link_frame,
        notes=robot.notes,
        parents=tuple(parents),
        tip_body=tip,
        coordinates=_coordinates(movable, source),
    )


def _outward(robot: UrdfRobot, root: str) -> Iterator[UrdfJoint]:
    """All joints, branch by branch; joints on one link are sorted by name."""
    stack = [root]
    above = {joint.child: joint for joint in robot.joints}
    while stack:
        link = stack.pop()
        if link in above:
            yield above[link]
        below = sorted(robot.joints_below(link), key=lambda joint: joint.name)
        stack += [joint.child for joint in reversed(below)]


def _refuse_unsupported(movable: Sequence[UrdfJoint], source: str) -> None:
    others = [joint for joint in movable if joint.type not in MOVABLE]
    if others:
        faults = "; ".join(
            f"joint {shown(joint.name)}: type {shown(joint.type)} is not supported" for joint in others
        )
        raise InputError(f"{source}: {faults}", f"psdmc reads {', '.join(MOVABLE)} and fixed joints")
    if not movable:
        raise InputError(f"{source}: no movable joint", f"joint types: {', '.join(MOVABLE)}")
    if len(movable) > MAX_JOINTS:
        raise InputError(
            f"{source}: {len(movable)} movable joints, psdmc reads at most {MAX_JOINTS}",
            "leave some links out",
        )


def _placed(robot: UrdfRobot, ordered: Sequence[UrdfJoint], snap: float) -> tuple[list[Joint], list[int]]:
    """Movable joints in their parents' frames, and those parents."""
    reach = sum(math.hypot(*joint.origin.xyz) for joint in ordered)
    where: dict[str, tuple[int, Placement]] = {robot.root: (BASE, Placement.identity())}
    joints: list[Joint] = []
    parents: list[int] = []
    for joint in ordered:
        body, outer = where[joint.parent]
        at = outer @ placement_of(joint.origin, snap)
        if not joint.is_movable:
            where[joint.child] = body, at
            continue
        axis, _ = snap_axis(np.array(joint.axis), snap)
        link = Placement(link_rotation(axis), np.zeros(3))
        placement = merged_placement(at @ link.inverse(), "", snap, [], 0, reach)
        where[joint.child] = len(joints), link
        joints.append(movable_joint(joint, placement, link))
        parents.append(body)
    return joints, parents


def _coordinates(movable: Sequence[UrdfJoint], source: str) -> tuple[Coordinate, ...]:
    index = {joint.name: i for i, joint in enumerate(movable)}
    found = []
    for i, joint in enumerate(movable):
        ratio, offset, here, passed = 1.0, 0.0, joint, [joint.name]
        while here.mimic is not None:
            ratio, offset = ratio * here.mimic.multiplier, offset + ratio * here.mimic.offset
            leader = here.mimic.joint
            if leader in passed:
                raise InputError(
                    f"{source}: joint {shown(joint.name)} mimics itself, by way of {shown(passed[-1])}",
                    "let one of these joints mimic none",
                )
            if leader not in index:
                raise InputError(
                    f"{source}: joint {shown(here.name)} mimics {shown(leader)}, which is no movable joint",
                    "correct its <mimic joint=...>",
                )
            passed.append(leader)
            here = movable[index[leader]]
        found.append(Coordinate(index[here.name], ratio, offset) if joint.mimic else Coordinate(i))
    return tuple(found)
