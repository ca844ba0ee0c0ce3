"""Mimic joints of a URDF as coordinates: q = ratio q_leader + offset, the leader's coordinate its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.limits import shown
from psdmc.robot.urdf import UrdfJoint


def mimic_coordinates(
    movable: Sequence[UrdfJoint], every: Sequence[UrdfJoint], source: str
) -> tuple[Coordinate, ...]:
    """Each movable joint's coordinate; one that follows a follower has the first leader's.

    movable  the robot's joints, in order
    every    all joints of the file
    InputError names followers that go round in a ring, and leaders that are no joints of the robot.
    """
    known = {joint.name: joint for joint in every}
    index = {joint.name: i for i, joint in enumerate(movable)}
    return tuple(
        Coordinate(i) if joint.mimic is None else _followed(joint, known, index, source)
        for i, joint in enumerate(movable)
    )


def _followed(
    joint: UrdfJoint, known: Mapping[str, UrdfJoint], index: Mapping[str, int], source: str
) -> Coordinate:
    ratio, offset, here, passed = 1.0, 0.0, joint, [joint.name]
    while here.mimic is not None:
        ratio, offset = ratio * here.mimic.multiplier, offset + ratio * here.mimic.offset
        leader = here.mimic.joint
        if leader in passed:
            raise InputError(
                f"{source}: joint {shown(joint.name)} mimics itself, by way of {shown(passed[-1])}",
                "let one of these joints mimic none",
            )
        if leader not in known or not known[leader].is_movable:
            raise InputError(
                f"{source}: joint {shown(here.name)} mimics {shown(leader)}, which is no movable joint",
                "correct its <mimic joint=...>",
            )
        passed.append(leader)
        here = known[leader]
    if here.name not in index:
        raise InputError(
            f"{source}: joint {shown(joint.name)} mimics {shown(here.name)}, which does not move the chain",
            "choose another --tip or --base, or none for the whole tree",
        )
    return Coordinate(index[here.name], ratio, offset)
