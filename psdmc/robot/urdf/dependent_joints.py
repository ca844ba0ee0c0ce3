"""Joints of a URDF that have no coordinate of their own: mimic joints and locked joints.

A mimic joint follows another joint: q = ratio q_leader + offset, where the leader is no mimic joint. A locked joint stays
at a position, and later steps treat it as a fixed joint.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from psdmc.errors import InputError
from psdmc.robot.coordinates import Coordinate
from psdmc.robot.joints import URDF_TYPES
from psdmc.robot.limits import ANGLE, LENGTH, RATIO, listed, shown
from psdmc.robot.placement import Placement, link_rotation, snap_axis
from psdmc.robot.urdf.read_urdf import LOCKABLE, UrdfJoint, UrdfRobot


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

    Raises InputError if mimic joints form a ring, if a leader is not a joint of the robot, or if a ratio or an offset is
    out of range.
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
        accepted = LENGTH if URDF_TYPES[joint.type].length_order else ANGLE
        for what, value, of in (("ratio", ratio, RATIO), ("offset", offset, accepted)):
            if fault := of.fault(value):
                raise InputError(
                    f"{source}: joint {shown(joint.name)} mimics {shown(leader.name)}: its {what} {value:g} {fault}",
                    "write positions within a few turns, in rad and m",
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


def held_positions(robot: UrdfRobot, lock: Mapping[str, float], source: str) -> dict[str, float]:
    """Return the position, rad or m, of each locked joint. These are joints in `lock`, mimic joints that follow one, and
    mimic joints with a multiplier of zero.

    Raises InputError if `lock` names no movable joint or a position that the joint cannot have, and for joints of a
    type that URDF does not have.
    """
    known = {joint.name: joint for joint in robot.joints}
    movable = [joint.name for joint in robot.joints if joint.is_movable]
    for name, value in lock.items():
        if name not in movable:
            what = "is fixed already" if name in known else "does not exist"
            raise InputError(
                f"{source}: joint {shown(name)}, to be locked, {what}", f"movable joints: {listed(movable)}"
            )
        if not _has_position(known[name]) and value != 0.0:
            raise InputError(
                f"{source}: joint {shown(name)} of type {shown(known[name].type)} is locked at {value:g}",
                "such joints are locked where they are in the file: at 0",
            )
    found = dict(lock)
    for joint in robot.joints:
        if joint.mimic is None or joint.name in lock or not joint.is_movable:
            continue
        leader = followed(joint, known, source, lock)
        if leader.joint.name in lock or leader.ratio == 0.0:
            found[joint.name] = leader.position(lock.get(leader.joint.name, 0.0))
    strange = [name for name in found if known[name].type not in LOCKABLE]
    if strange:
        raise InputError(
            f"{source}: joint {shown(strange[0])}, to be locked, is of type {shown(known[strange[0]].type)}",
            f"types of joints that can be held: {listed([kind for kind in LOCKABLE if kind != 'fixed'])}",
        )
    # A position must be one that sines are exact for, or a length of a robot.
    for name, value in found.items():
        kind = URDF_TYPES.get(known[name].type)
        fault = (LENGTH if kind is not None and kind.length_order > 0 else ANGLE).fault(value)
        if fault:
            raise InputError(
                f"{source}: joint {shown(name)} is to be locked at {value:g}, which {fault}",
                "positions are in rad or m",
            )
    return found


def locked(robot: UrdfRobot, lock: Mapping[str, float], source: str) -> UrdfRobot:
    """Return the robot with the locked joints fixed at their positions, and a note for each of these joints."""
    held = held_positions(robot, lock, source)
    if not held:
        return robot
    notes = [_note(joint, held, lock) for joint in robot.joints if joint.name in held]
    joints = tuple(
        replace(joint, type="fixed", mimic=None, held=_moved(joint, held[joint.name]))
        if joint.name in held
        else joint
        for joint in robot.joints
    )
    return replace(robot, joints=joints, notes=(*robot.notes, *notes))


def _note(joint: UrdfJoint, held: Mapping[str, float], lock: Mapping[str, float]) -> str:
    limits, value = joint.limits, held[joint.name]
    beyond = "" if limits.lower <= value <= limits.upper else ", beyond its limits"
    leader = joint.mimic.joint if joint.mimic is not None and joint.name in lock else None
    parted = f", and no longer follows {shown(leader)}" if leader is not None and leader not in held else ""
    return f"joint '{joint.name}' is locked at {value:g}{beyond}{parted}"


def _moved(joint: UrdfJoint, value: float) -> Placement:
    """The placement of the child in the file's joint frame; at zero if the type has no single position."""
    if not _has_position(joint):
        return Placement.identity()
    axis = Placement(link_rotation(snap_axis(np.array(joint.axis), 0.0)[0]), np.zeros(3))
    return axis.inverse() @ URDF_TYPES[joint.type].transform(value) @ axis


def _has_position(joint: UrdfJoint) -> bool:
    """Whether one number says where it is."""
    return joint.type in URDF_TYPES and URDF_TYPES[joint.type].about_z


def parsed_lock(texts: Sequence[str]) -> dict[str, float]:
    """Return positions by joint name from texts of the command line such as "elbow=0.5" (rad or m)."""
    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.rpartition("=")
        try:
            number = float(value)
        except ValueError:
            number = np.nan
        if not equals or not name or not np.isfinite(number):
            raise InputError(
                f"--lock {shown(text)} is no JOINT=VALUE", "such as --lock elbow=0.5, in rad or m"
            )
        if name in found:
            raise InputError(f"--lock names joint {shown(name)} twice", "name each once")
        found[name] = number
    return found
