"""Makes a robot from a URDF: places joints, and merges the inertias of links that move together."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psdmc.errors import InputError
from psdmc.reproducible import times
from psdmc.robot.draft import BASE, Draft, Snap
from psdmc.robot.inertia import inertia_matrix, physical_fault, six_of, standard_parameters, without_noise
from psdmc.robot.joints import FREE, REVOLUTE, URDF_TYPES, JointType
from psdmc.robot.limits import free_name, listed, shown
from psdmc.robot.load_options import LoadOptions
from psdmc.robot.mechanism import BASE as ON_BASE
from psdmc.robot.mechanism import Array, Joint, Limits, NamedFrame, Placement
from psdmc.robot.placement import (
    ROUNDING,
    angle_between,
    coarse_right_angles,
    from_quaternion,
    link_rotation,
    roll_pitch_yaw,
    snap_axis,
    snap_rotation,
    snap_translation,
)
from psdmc.robot.urdf.dependent_joints import held_positions, locked, mimic_coordinates
from psdmc.robot.urdf.missing_inertia import judged_bodies
from psdmc.robot.urdf.pinocchio_text import JOINT_PREFIX, locked_at, pinocchio_model
from psdmc.robot.urdf.read_urdf import LOCKABLE, Origin, UrdfInertial, UrdfJoint, UrdfRobot, read_urdf
from psdmc.robot.urdf.tree import Route, find_route

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
        robot = on_floating_base(robot)
    route = find_route(robot, options.base, options.tip, source, frames)
    placed = _placed(route, snap)
    base_rotation, base_snaps = _base_rotation(route, snap)
    root_gravity = np.array(STANDARD_GRAVITY if options.gravity is None else options.gravity)
    links = bodies_of(robot, route.movable)
    bodies = [without_noise(_merged(robot, body)) for body in links]
    hold_against_pinocchio(robot, route, bodies, text, source, held_positions(read, options.lock, source))
    found = judged_bodies(robot, route, links, bodies, options.unknown, source)
    frame_of_link = _LinkFrames(robot, route, placed.joints, placed.tip, source)
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
        frames=tuple(map(frame_of_link.of, frames or route.ends)),
        parents=placed.parents,
        tip_body=placed.tip.joint,
        coordinates=mimic_coordinates(route.movable, robot.joints, source),
        massless=found.massless,
        frame_of=frame_of_link.of_or_in_base,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """Joints one in the other, the bodies that they hang on, the tip, and what was snapped on the path."""

    joints: tuple[Joint, ...]
    parents: tuple[int, ...]
    tip: NamedFrame
    snaps: tuple[Snap, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Reached:
    """Where a link is: on which body, at which place in its joint frame, and what was snapped since that joint."""

    body: int
    place: Placement
    snapped: tuple[Snap, ...] = ()


def _placed(route: Route, snap: float) -> _Placed:
    """Each turn is snapped as it is read, so that products of exact rotations stay exact; then once more what
    several merged ones came to.

    A turn that several joints lie beyond was snapped on the path to each of them.
    """
    reach = _reach(route)
    reached = {route.base: _Reached(ON_BASE, Placement.identity())}
    joints: list[Joint] = []
    parents: list[int] = []
    snaps: list[Snap] = []
    for joint in route.path:
        outer, n = reached[joint.parent], len(joints)
        turned = list(outer.snapped)
        at = outer.place @ _origin(joint, snap, turned, n)
        if not joint.is_movable:
            reached[joint.child] = _Reached(outer.body, at, tuple(turned))
            continue
        axis, angle = snap_axis(np.array(joint.axis if _kind(joint).follows_axis else ALONG_Z), snap)
        _record(turned, f"axis of joint '{joint.name}'", angle, n)
        link = Placement(link_rotation(axis), np.zeros(3))
        where = f"joint '{joint.name}', merged"
        placement = merged_placement(at @ link.inverse(), where, snap, turned, n, reach)
        joints.append(Joint(joint.name, joint.child, _kind(joint), placement, link, joint.limits))
        parents.append(outer.body)
        snaps += [replace(one, segment=n) for one in turned]
        reached[joint.child] = _Reached(n, link)
    end, n = reached[route.tip], len(joints)
    turned = list(end.snapped)
    tip = merged_placement(end.place, f"tip '{route.tip}', merged", snap, turned, n, reach)
    snaps += [replace(one, segment=n) for one in turned]
    return _Placed(tuple(joints), tuple(parents), NamedFrame(route.tip, end.body, tip), tuple(snaps))


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


AGREEMENT = 1e-11
"""Allowed difference relative to the largest parameter of the body's mass, moments or inertias: rounding of angles up
to 1e3 rad leaves 1e-13, another reading of a number far more."""


def _reach(route: Route) -> float:
    """The longest path from the base outward, m: every step as the file has it."""
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


def bodies_of(robot: UrdfRobot, movable: Sequence[UrdfJoint]) -> list[dict[str, Placement]]:
    """Return for each movable joint the links that it moves together, up to the next movable joints. A link has the
    placement in the frame of the joint's child link, which comes first. All other joints are locked at their neutral
    position."""
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
    free = robot.root_joint
    alone = pinocchio_model(text, source, kinds=dict.fromkeys(LOCKABLE, REVOLUTE.word), root_joint=free)
    for joint in robot.joints:
        own = body_parameters(robot.inertials[joint.child], Placement.identity())
        _compare(
            own, alone.inertias[alone.getJointId(JOINT_PREFIX + joint.name)], joint.child, "the body", source
        )
    movable = [joint.name for joint in route.movable]
    whole = locked_at(pinocchio_model(text, source, [*movable, *held], root_joint=free), held)
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
            values = " and ".join(" ".join(f"{x:.9g}" for x in each[group]) for each in (own, found))
            raise InputError(
                f"{source}: link '{link}': psdmc and Pinocchio read {what} differently: {values}",
                "write its numbers as plain decimals, and report the file: one of the two readers is wrong",
            )


# A root link on a free joint, and links as named frames.
ROOT_JOINT = "root_joint"
"""Pinocchio's name of the free joint; more underscores follow where a joint of the file is called so."""

WORLD = "universe"
"""Pinocchio's name of what the free joint hangs on; more underscores follow where a link of the file is called so."""


def on_floating_base(robot: UrdfRobot) -> UrdfRobot:
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
        root_joint=name,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _LinkFrames:
    """Frames of links, placed by the numbers of the file. The placement of the tip equals that in the chain."""

    robot: UrdfRobot
    route: Route
    joints: tuple[Joint, ...]
    tip: NamedFrame
    source: str

    def of(self, name: str) -> NamedFrame:
        """Return the named frame of a link. Raises InputError if the link does not exist, does not move, or is not rigidly
        attached to a link of the chain."""
        if name == self.tip.name:
            return self.tip
        carriers = {joint.name: number for number, joint in enumerate(self.joints)}
        fixed, carrier = self._carried_by(name)
        if carrier is not None and carrier.name in carriers:
            number = carriers[carrier.name]
            place = self.joints[number].link_frame
            for joint in fixed:
                place = place @ place_of(joint)
            return NamedFrame(name, number, place)
        hint = "links that can be frames:"
        if name not in self.robot.inertials:
            fault = "is no link of the file"
        elif carrier is None:
            fault = "is fixed to the root: no joint moves it"
        else:
            ends = f"'{self.route.base}' and the tip '{self.route.tip}'"
            where = "above the base" if carrier in self.route.to_base else f"not between {ends}"
            fault = f"moves with joint '{carrier.name}', which is {where}: it is on no link of the chain"
            hint = "choose another --tip or --base, or one of"
        above = {link: self._carried_by(link)[1] for link in self.robot.inertials}
        rigid = [link for link, joint in above.items() if joint is not None and joint.name in carriers]
        raise InputError(f"{self.source}: frame {shown(name)} {fault}", f"{hint} {listed(rigid)}")

    def of_or_in_base(self, name: str) -> NamedFrame:
        """Return the frame of a link, placed in the base frame (joint BASE) if no joint moves the link."""
        fixed, carrier = self._carried_by(name)
        if name not in self.robot.inertials or carrier is not None:
            return self.of(name)
        place = Placement.identity()
        for joint in self.route.to_base:
            place = place @ place_of(joint)
        place = place.inverse()
        for joint in fixed:
            place = place @ place_of(joint)
        return NamedFrame(name, ON_BASE, place)

    def _carried_by(self, link: str) -> tuple[list[UrdfJoint], UrdfJoint | None]:
        """Fixed joints from the link that a joint moves down to this link, and that joint; None at the root."""
        above = self.robot.above
        fixed: list[UrdfJoint] = []
        while link in above and not above[link].is_movable:
            fixed.append(above[link])
            link = above[link].parent
        return fixed[::-1], above.get(link)
