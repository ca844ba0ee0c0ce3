"""Makes a robot from a URDF: places joints, and merges the inertias of links that move together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.errors import InputError
from psdmc.reproducible import times
from psdmc.robot.draft import BASE, Draft, Snap
from psdmc.robot.inertia import physical_fault
from psdmc.robot.joints import FREE, URDF_TYPES, JointType
from psdmc.robot.limits import listed, shown
from psdmc.robot.load_options import LoadOptions
from psdmc.robot.lock import held_positions, locked
from psdmc.robot.mechanism import BASE as ON_BASE
from psdmc.robot.mechanism import Array, Joint, Limits, NamedFrame, Placement
from psdmc.robot.mimic import mimic_coordinates
from psdmc.robot.missing_inertia import judged_bodies
from psdmc.robot.names import free_name
from psdmc.robot.snap import (
    ROUNDING,
    angle_between,
    coarse_right_angles,
    link_rotation,
    snap_axis,
    snap_rotation,
    snap_translation,
)
from psdmc.robot.tree import Route, find_route
from psdmc.robot.urdf import Origin, UrdfJoint, UrdfRobot, read_urdf
from psdmc.robot.urdf_bodies import bodies_of, hold_against_pinocchio, merged_parameters, place_of

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""m/s^2 in the root frame, as in Pinocchio."""

ALONG_Z = (0.0, 0.0, 1.0)


def urdf_draft(text: str, source: str, options: LoadOptions) -> Draft:
    """Return the robot of a URDF: the chain from base to tip, or the whole tree (see find_route). Gravity is in the
    root frame.

    The options determine snapped rotations, locked joints, a floating base and unknown inertias. If the options name no
    frames, the named frames of a tree are the end links.
    """
    snap, frames = options.snap, options.frames
    read = read_urdf(text, source)
    robot = locked(read, options.lock, source)
    if options.floating:
        robot = on_free_root(robot)
    route = find_route(robot, options.base, options.tip, source, frames)
    placed = _placed(route, snap)
    base_rotation, base_snaps = _base_rotation(route, snap)
    root_gravity = np.array(STANDARD_GRAVITY if options.gravity is None else options.gravity)
    bodies = merged_parameters(robot, route)
    hold_against_pinocchio(robot, route, bodies, text, source, held_positions(read, options.lock, source))
    found = judged_bodies(robot, route, bodies_of(robot, route.movable), bodies, options.unknown, source)
    springy = [joint.name for joint in route.movable if joint.has_dynamics]
    unmodelled = (
        [f"<dynamics> (damping, friction) of joints is not modelled: {listed(springy)}"] if springy else []
    )
    return Draft(
        name=robot.name,
        convention="urdf",
        base_name=route.base,
        tip_name=route.tip,
        joints=placed.joints,
        parameters=found.parameters,
        zeros=found.zeros,
        drives=(False,) * len(placed.joints),
        gravity=times(base_rotation.T, root_gravity) + 0.0,
        tip=placed.tip.placement,
        snaps=(*base_snaps, *placed.snaps),
        notes=(
            *robot.notes,
            *route.notes,
            *found.notes,
            *_of_several_coordinates(route),
            *unmodelled,
            *coarse_right_angles(
                {j.name: j.origin.rpy for j in route.path if j.origin.quaternion is None}, snap
            ),
            *_faults(robot),
        ),
        frames=urdf_frames(robot, route, placed.joints, placed.tip, frames or route.ends, source),
        parents=placed.parents,
        tip_body=placed.tip.joint,
        coordinates=mimic_coordinates(route.movable, robot.joints, source),
        massless=found.massless,
        frame_of=lambda name: base_or_frame(robot, route, placed.joints, placed.tip, name, source),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """Joints one in the other, the bodies that they hang on, the tip, and what was snapped on the way."""

    joints: tuple[Joint, ...]
    parents: tuple[int, ...]
    tip: NamedFrame
    snaps: tuple[Snap, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """Where a link is: on which body, at which place in its joint frame, and what was snapped since that joint."""

    body: int
    place: Placement
    snapped: tuple[Snap, ...] = ()


def _placed(route: Route, snap: float) -> _Placed:
    """Each turn is snapped as it is read, so that products of exact rotations stay exact; then once more what
    several merged ones came to.

    A turn that several joints lie beyond was snapped on the way to each of them.
    """
    reach = _reach(route)
    ways = {route.base: _Way(ON_BASE, Placement.identity())}
    joints: list[Joint] = []
    parents: list[int] = []
    snaps: list[Snap] = []
    for joint in route.path:
        outer, n = ways[joint.parent], len(joints)
        turned = list(outer.snapped)
        at = outer.place @ _origin(joint, snap, turned, n)
        if not joint.is_movable:
            ways[joint.child] = _Way(outer.body, at, tuple(turned))
            continue
        axis, angle = snap_axis(np.array(joint.axis if _kind(joint).follows_axis else ALONG_Z), snap)
        _record(turned, f"axis of joint '{joint.name}'", angle, n)
        link = Placement(link_rotation(axis), np.zeros(3))
        where = f"joint '{joint.name}', merged"
        placement = merged_placement(at @ link.inverse(), where, snap, turned, n, reach)
        joints.append(Joint(joint.name, joint.child, _kind(joint), placement, link, joint.limits))
        parents.append(outer.body)
        snaps += [replace(one, segment=n) for one in turned]
        ways[joint.child] = _Way(n, link)
    end, n = ways[route.tip], len(joints)
    turned = list(end.snapped)
    tip = merged_placement(end.place, f"tip '{route.tip}', merged", snap, turned, n, reach)
    snaps += [replace(one, segment=n) for one in turned]
    return _Placed(tuple(joints), tuple(parents), NamedFrame(route.tip, end.body, tip), tuple(snaps))


def _reach(route: Route) -> float:
    """The longest way from the base outward, m: every step as the file has it."""
    far = {route.base: 0.0}
    for joint in route.path:
        far[joint.child] = far[joint.parent] + math.hypot(*joint.origin.xyz)
    return max(far.values())


def _kind(joint: UrdfJoint) -> JointType:
    return URDF_TYPES[joint.type]


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
    place, unsnapped = place_of(joint, snap), place_of(joint)
    _record(snaps, f"joint '{joint.name}'", angle_between(place.rotation, unsnapped.rotation), segment)
    return place


def merged_placement(
    place: Placement, where: str, snap: float, snaps: list[Snap], segment: int, reach: float
) -> Placement:
    """Return the product of several placements, with the rotation snapped (replaced by a near one with exact zeros).
    The angle of this change is appended to `snaps`."""
    rotation, angle = snap_rotation(place.rotation, snap)
    _record(snaps, where, angle, segment)
    return Placement(rotation, snap_translation(place.translation, reach))


def _record(snaps: list[Snap], where: str, angle: float, segment: int) -> None:
    if angle > ROUNDING:
        snaps.append(Snap(where, angle, segment))


def _of_several_coordinates(route: Route) -> list[str]:
    """A note for each joint of several coordinates: what moves, and what its coordinates are."""
    return [
        f"link {shown(joint.child)} {_kind(joint).verb} by joint {shown(joint.name)}: {_kind(joint).coordinates}"
        for joint in route.movable
        if not _kind(joint).about_z
    ]


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


# A root link on a free joint, and links as named frames.
ROOT_JOINT = "root_joint"
"""Pinocchio's name of the free joint; more underscores follow where a joint of the file is called so."""

WORLD = "universe"
"""Pinocchio's name of what the free joint hangs on; more underscores follow where a link of the file is called so."""


def on_free_root(robot: UrdfRobot) -> UrdfRobot:
    """Return the robot with a free joint between the world frame and the frame of the root link."""
    name = free_name(ROOT_JOINT, {joint.name for joint in robot.joints})
    world = free_name(WORLD, set(robot.inertials))
    free = UrdfJoint(
        name=name,
        type=FREE.urdf_words[0],
        parent=world,
        child=robot.root,
        origin=Origin(),
        axis=(0.0, 0.0, 1.0),
        limits=Limits(),
        mimic=None,
        has_dynamics=False,
    )
    return replace(
        robot,
        root=world,
        inertials={world: None, **robot.inertials},
        joints=(free, *robot.joints),
        free_root=name,
    )


def urdf_frames(
    robot: UrdfRobot,
    route: Route,
    joints: Sequence[Joint],
    tip: NamedFrame,
    names: Iterable[str],
    source: str,
) -> tuple[NamedFrame, ...]:
    """Return the named frames of these links, placed by the numbers of the file. The placement of the tip equals that
    in the chain.

    Raises InputError if a link does not exist, does not move, or is not rigidly attached to a link of the chain.
    """
    carriers = {joint.name: number for number, joint in enumerate(joints)}
    return tuple(
        tip if name == tip.name else _frame_on(robot, route, joints, carriers, name, source) for name in names
    )


def base_or_frame(
    robot: UrdfRobot, route: Route, joints: Sequence[Joint], tip: NamedFrame, name: str, source: str
) -> NamedFrame:
    """Return the frame of a link, placed in the base frame (joint BASE) if no joint moves the link."""
    fixed, carrier = _carried_by(robot, name)
    if name not in robot.inertials or carrier is not None:
        return urdf_frames(robot, route, joints, tip, (name,), source)[0]
    place = Placement.identity()
    for joint in route.to_base:
        place = place @ place_of(joint)
    place = place.inverse()
    for joint in fixed:
        place = place @ place_of(joint)
    return NamedFrame(name, ON_BASE, place)


def _frame_on(
    robot: UrdfRobot, route: Route, joints: Sequence[Joint], carriers: dict[str, int], name: str, source: str
) -> NamedFrame:
    if name not in robot.inertials:
        raise InputError(
            f"{source}: frame {shown(name)} is no link of the file",
            f"links that can be frames: {listed(_rigid(robot, carriers))}",
        )
    fixed, carrier = _carried_by(robot, name)
    if carrier is None:
        raise InputError(
            f"{source}: frame {shown(name)} is fixed to the root: no joint moves it",
            f"links that can be frames: {listed(_rigid(robot, carriers))}",
        )
    if carrier.name not in carriers:
        above = carrier in route.to_base
        where = "above the base" if above else f"not between '{route.base}' and the tip '{route.tip}'"
        raise InputError(
            f"{source}: frame {shown(name)} moves with joint '{carrier.name}', which is {where}: it is on no link of the "
            "chain",
            f"choose another --tip or --base, or one of {listed(_rigid(robot, carriers))}",
        )
    number = carriers[carrier.name]
    place = joints[number].link_frame
    for joint in fixed:
        place = place @ place_of(joint)
    return NamedFrame(name, number, place)


def _carried_by(robot: UrdfRobot, link: str) -> tuple[list[UrdfJoint], UrdfJoint | None]:
    """Fixed joints from the link that a joint moves down to this link, and that joint; None at the root."""
    above = {joint.child: joint for joint in robot.joints}
    fixed: list[UrdfJoint] = []
    while link in above and not above[link].is_movable:
        fixed.append(above[link])
        link = above[link].parent
    return fixed[::-1], above.get(link)


def _rigid(robot: UrdfRobot, carriers: dict[str, int]) -> list[str]:
    """The links that may be frames."""
    found = []
    for link in robot.inertials:
        _, carrier = _carried_by(robot, link)
        if carrier is not None and carrier.name in carriers:
            found.append(link)
    return found
