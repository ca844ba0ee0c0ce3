"""From a URDF to a serial robot: joints placed and bodies merged with the file's own numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from psdmc.robot.draft import BASE, Draft, Snap
from psdmc.robot.inertia import physical_fault
from psdmc.robot.joints import URDF_TYPES
from psdmc.robot.mechanism import Array, Joint, NamedFrame, Placement
from psdmc.robot.small import times
from psdmc.robot.snap import ROUNDING, angle_between, snap_axis, snap_rotation, snap_translation
from psdmc.robot.tree import Route, find_route, listed
from psdmc.robot.urdf import UrdfJoint, UrdfRobot, read_urdf
from psdmc.robot.urdf_bodies import hold_against_pinocchio, merged_parameters, placement_of
from psdmc.robot.urdf_frames import urdf_frames

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""m/s^2 in the root frame, as in Pinocchio."""


def urdf_draft(
    text: str,
    source: str,
    base: str | None,
    tip: str | None,
    gravity: Array | None,
    snap: float,
    frames: Sequence[str] = (),
) -> Draft:
    """The chain from base to tip; gravity in the root frame; rotations near exact ones snapped (rad); the links `frames`
    as named frames."""
    robot = read_urdf(text, source)
    route = find_route(robot, base, tip, source)
    joints, tip_frame, snaps = _placed_joints(route, snap)
    base_rotation, base_snaps = _base_rotation(route, snap)
    root_gravity = np.array(STANDARD_GRAVITY) if gravity is None else gravity
    bodies = merged_parameters(robot, route)
    hold_against_pinocchio(robot, route, bodies, text, source)
    bare = [joint.link_name for joint, x in zip(joints, bodies, strict=True) if not x.any()]
    return Draft(
        name=robot.name,
        convention="urdf",
        base_name=route.base,
        tip_name=route.tip,
        joints=joints,
        parameters=tuple(np.append(x, 0.0) for x in bodies),
        zeros=tuple(("m",) if joint.link_name in bare else () for joint in joints),
        drives=(False,) * len(joints),
        gravity=times(base_rotation.T, root_gravity) + 0.0,
        tip=tip_frame,
        snaps=(*base_snaps, *snaps),
        notes=(
            *robot.notes,
            *route.notes,
            *(f"link '{link}' has no inertia: none assumed" for link in bare),
            *_unmodelled(route),
            *_faults(robot),
        ),
        frames=urdf_frames(robot, route, joints, _tip(route, joints, tip_frame), frames, source),
    )


def _tip(route: Route, joints: Sequence[Joint], place: Placement) -> NamedFrame:
    return NamedFrame(route.tip, len(joints) - 1, place)


def link_rotation(axis: Array) -> Array:
    """(3, 3) from a link's frame into a joint frame whose z is the unit axis given in the link.

    x is the coordinate axis that is most perpendicular to the joint's axis, made perpendicular: coordinate axes thus
    give exact signed permutations, and parallel axes parallel frames.
    """
    k = int(np.argmin(np.abs(axis)))
    x = np.eye(3)[k] - axis[k] * axis
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(axis, x), axis]) + 0.0


def _placed_joints(route: Route, snap: float) -> tuple[tuple[Joint, ...], Placement, list[Snap]]:
    """Joint frames in their parents', the tip in the last, and the snapped rotations.

    Each turn is snapped as it is read, so that products of exact rotations stay exact; then the product of several
    merged turns is snapped once more.
    """
    snaps: list[Snap] = []
    reach = sum(math.hypot(*joint.origin.xyz) for joint in route.path)
    joints: list[Joint] = []
    so_far = Placement.identity()
    for joint in route.path:
        so_far = so_far @ _origin(joint, snap, snaps, len(joints))
        if not joint.is_movable:
            continue
        axis, angle = snap_axis(np.array(joint.axis), snap)
        _record(snaps, f"axis of joint '{joint.name}'", angle, len(joints))
        link = Placement(link_rotation(axis), np.zeros(3))
        where = f"joint '{joint.name}', merged"
        placement = merged_placement(so_far @ link.inverse(), where, snap, snaps, len(joints), reach)
        joints.append(movable_joint(joint, placement, link))
        so_far = link
    tip = merged_placement(so_far, f"tip '{route.tip}', merged", snap, snaps, len(joints), reach)
    return tuple(joints), tip, snaps


def movable_joint(joint: UrdfJoint, placement: Placement, link: Placement) -> Joint:
    """The joint with its child link, whose frame sits at `link` in the joint frame."""
    return Joint(joint.name, joint.child, URDF_TYPES[joint.type], placement, link, joint.limits)


def _base_rotation(route: Route, snap: float) -> tuple[Array, list[Snap]]:
    """The base link's rotation in the root frame."""
    snaps: list[Snap] = []
    base = Placement.identity()
    for joint in route.to_base:
        base = base @ _origin(joint, snap, snaps, BASE)
    rotation, angle = snap_rotation(base.rotation, snap)
    _record(snaps, f"base '{route.base}', merged", angle, BASE)
    return rotation, snaps


def _origin(joint: UrdfJoint, snap: float, snaps: list[Snap], segment: int) -> Placement:
    """Where the child link's frame sits in the parent's at q = 0."""
    place, unsnapped = placement_of(joint.origin, snap), placement_of(joint.origin)
    _record(snaps, f"joint '{joint.name}'", angle_between(place.rotation, unsnapped.rotation), segment)
    return place


def merged_placement(
    place: Placement, where: str, snap: float, snaps: list[Snap], segment: int, reach: float
) -> Placement:
    """The product of several merged placements, snapped; the change is added to `snaps`."""
    rotation, angle = snap_rotation(place.rotation, snap)
    _record(snaps, where, angle, segment)
    return Placement(rotation, snap_translation(place.translation, reach))


def _record(snaps: list[Snap], where: str, angle: float, segment: int) -> None:
    if angle > ROUNDING:
        snaps.append(Snap(where, angle, segment))


def _unmodelled(route: Route) -> list[str]:
    """A note that names the chain's joints with friction, damping or springs, which the model of rigid bodies leaves
    out."""
    names = [joint.name for joint in route.movable if joint.has_dynamics]
    return [f"<dynamics> (damping, friction) of joints is not modelled: {listed(names)}"] if names else []


def _faults(robot: UrdfRobot) -> list[str]:
    """A note for each link whose inertia no body could have."""
    notes = []
    for link, inertial in robot.inertials.items():
        if inertial is None:
            continue
        fault = physical_fault(inertial.mass, np.array(inertial.inertia))
        if fault:
            notes.append(f"link '{link}': {fault}: not physical")
    return notes
