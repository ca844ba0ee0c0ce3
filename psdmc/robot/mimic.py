"""Converts the mimic joints of a URDF to coordinates: q = ratio q_leader + offset, where the leader is no mimic joint."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.joints import URDF_TYPES
from psdmc.robot.limits import shown
from psdmc.robot.urdf import UrdfJoint


class Followed(NamedTuple):
    """Describes which joint a mimic joint follows, maybe through others: q = ratio q_joint + offset."""

    joint: UrdfJoint
    ratio: float
    offset: float

    def position(self, q: float) -> float:
        """Return the position of a mimic joint from the position q of the joint that it follows."""
        return self.ratio * q + self.offset


def mimic_coordinates(
    movable: Sequence[UrdfJoint], every: Sequence[UrdfJoint], source: str
) -> tuple[Coordinate, ...]:
    """Return the coordinate of each movable joint, which says which joint it follows. If a mimic joint follows another
    mimic joint, the leader is the first joint of the sequence that follows none.

    movable  the robot's joints, in order
    every    all joints of the file

    Raises InputError if mimic joints form a ring, or if a leader is not a joint of the robot.
    """
    known = {joint.name: joint for joint in every}
    index = {joint.name: i for i, joint in enumerate(movable)}
    found = []
    for i, joint in enumerate(movable):
        if joint.mimic is None:
            found.append(Coordinate(i))
            continue
        leader, ratio, offset = followed(joint, known, source)
        if leader.name not in index:
            raise InputError(
                f"{source}: joint {shown(joint.name)} mimics {shown(leader.name)}, which does not move the chain",
                "choose another --tip or --base, or none for the whole tree; or hold it with --lock",
            )
        found.append(Coordinate(index[leader.name], ratio, offset))
    return tuple(found)


def followed(
    joint: UrdfJoint, known: Mapping[str, UrdfJoint], source: str, ends: Collection[str] = ()
) -> Followed:
    """Return the joint that a mimic joint follows, directly or through other mimic joints. The search ends at a joint
    that is no mimic joint, or that is among `ends`.

    Raises InputError if the joints form a ring, or if the leader is not a movable joint.
    """
    _refuse_wide(joint, source)
    ratio, offset, here, passed = 1.0, 0.0, joint, [joint.name]
    while here.mimic is not None and (here is joint or here.name not in ends):
        ratio, offset = ratio * here.mimic.multiplier, offset + ratio * here.mimic.offset
        leader = here.mimic.joint
        if leader in passed:
            raise InputError(
                f"{source}: joint {shown(joint.name)} mimics itself through {shown(passed[-1])}",
                "let one of these joints mimic none",
            )
        if leader not in known or not known[leader].is_movable:
            raise InputError(
                f"{source}: joint {shown(here.name)} mimics {shown(leader)}, which is no movable joint",
                "correct its <mimic joint=...>",
            )
        passed.append(leader)
        here = known[leader]
        _refuse_wide(here, source)
    return Followed(here, ratio, offset)


def _refuse_wide(joint: UrdfJoint, source: str) -> None:
    """InputError where a joint that follows, or is followed, has several coordinates."""
    if joint.type in URDF_TYPES and not URDF_TYPES[joint.type].about_z:
        raise InputError(
            f"{source}: joint {shown(joint.name)} of type {shown(joint.type)} has several coordinates: such joints"
            " neither follow others by <mimic> nor lead them",
            "leave that <mimic> out",
        )
