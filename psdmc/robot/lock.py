"""Locks joints of a URDF at a position. Later steps treat them as fixed joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from psdmc.errors import InputError
from psdmc.robot.joints import URDF_TYPES
from psdmc.robot.limits import ANGLE, LENGTH, listed, shown
from psdmc.robot.mimic import followed
from psdmc.robot.placement import Placement
from psdmc.robot.snap import link_rotation, snap_axis
from psdmc.robot.urdf import LOCKABLE, UrdfJoint, UrdfRobot


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


def parsed(texts: Sequence[str]) -> dict[str, float]:
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
