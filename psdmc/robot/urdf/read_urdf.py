"""Reads a URDF into plain data and checks every number. The joints of the robot are selected later (tree.py)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar
from xml.etree.ElementTree import Element

from psdmc.errors import WARNING, InputError
from psdmc.robot import limits
from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.joints import URDF_TYPES
from psdmc.robot.limits import listed, name_faults, naming_faults, shown
from psdmc.robot.mechanism import Limits, Placement
from psdmc.robot.urdf.urdf_words import (
    VERSIONS,
    has_dynamics,
    joint_faults,
    link_faults,
    robot_faults,
    unread_words,
)
from psdmc.robot.xml_text import number, numbers, only, parse_xml, required_number

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]

MOVABLE = tuple(URDF_TYPES)
"""Joint types that psdmc models; fixed ones are merged, all others refused on the chain."""

LOCKABLE = (*MOVABLE, "fixed")
"""Joint types that have a neutral position, where those beside the chain are locked."""

UNIT_SLACK = 1e-2
"""Accepted deviation of a quaternion's length from one, for quaternions of two digits such as 0.71 0 0 0.71; they are
normalized."""


@dataclass(frozen=True, slots=True)
class Origin:
    """A frame's placement in another, as in a URDF: xyz (m), and rpy (rad) or a unit quaternion (x, y, z, w)."""

    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)
    quaternion: Quadruple | None = None


@dataclass(frozen=True, slots=True)
class UrdfInertial:
    """The element <inertial> of a link: mass in kg, and inertia in kg m^2 (INERTIA_NAMES). The inertia is about the
    centre of mass, along the axes of the inertial frame. `origin` is the placement of the inertial frame in the link;
    the origin of this frame is the centre of mass."""

    mass: float
    inertia: tuple[float, ...]
    origin: Origin


@dataclass(frozen=True, slots=True)
class Mimic:
    """The element <mimic> of a joint: q = multiplier * (q of the joint with the name `joint`) + offset."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """One element <joint> of a URDF.

    origin        placement of the child link in the parent at q = 0
    axis          axis of the joint in the child link
    mimic         for a mimic joint, which joint is followed, and how
    has_dynamics  whether the joint has friction, damping or a spring
    held          for a locked joint, the additional placement of the child by the locked position
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Origin
    axis: Triple
    limits: Limits
    mimic: Mimic | None
    has_dynamics: bool
    held: Placement | None = None

    @property
    def is_movable(self) -> bool:
        return self.type != "fixed"


@dataclass(frozen=True, slots=True)
class UrdfRobot:
    """The content of a URDF: a tree of links. `inertials` contains every link in the file's order, and None for a link
    without <inertial>.

    notes      content of the file that psdmc ignores, one sentence each
    root_joint the free joint that was added above the file's root link, if any
    shapes     links with collision shapes only: they have neither inertia nor a visual
    """

    name: str
    root: str
    inertials: dict[str, UrdfInertial | None]
    joints: tuple[UrdfJoint, ...]
    notes: tuple[str, ...]
    root_joint: str | None = None
    shapes: tuple[str, ...] = ()

    @property
    def above(self) -> dict[str, UrdfJoint]:
        """The joint above each link, by the link's name; the root has none."""
        return {joint.child: joint for joint in self.joints}

    def joints_below(self, link: str) -> tuple[UrdfJoint, ...]:
        return tuple(joint for joint in self.joints if joint.parent == link)


def read_urdf(text: str, source: str) -> UrdfRobot:
    """Return the content of a URDF. Raises one InputError that names all faults of its links and joints."""
    root = parse_xml(text, source, "robot")
    hint = f"psdmc reads URDF {VERSIONS[0]} to {VERSIONS[-1]}; see docs/robot_files.md"
    _refuse(robot_faults(root), source, hint)
    _refuse_sizes(root, source)
    problems = name_faults(root.get("name", ""), "robot")
    for tag in ("link", "joint"):
        problems += naming_faults([element.get("name", "") for element in root.findall(tag)], tag)
    _refuse(problems, source, "names tell links and joints apart: correct them")
    problems = []
    bodies = _each(root, "link", lambda link: (link.get("name", ""), _inertial(link)), problems)
    joints = _each(root, "joint", _joint, problems)
    _refuse(problems, source, "correct the file; docs/robot_files.md says what it may hold")
    inertials = dict(bodies)
    if not inertials:
        raise InputError(f"{source}: no <link> in it", "give a URDF with links and joints")
    ends = [(joint.name, joint.parent, joint.child) for joint in joints]
    _refuse(
        tree_faults(list(inertials), ends), source, "a robot is a tree: one root, one parent joint per link"
    )
    places = [joint.origin.xyz for joint in joints] + [b.origin.xyz for b in inertials.values() if b]
    fault = limits.scale_fault(length for xyz in places for length in xyz)
    _refuse([fault] if fault else [], source, "lengths are in metres")
    children = {joint.child for joint in joints}
    base = next(name for name in inertials if name not in children)
    notes = [] if root.get("name") else ["the file names no robot: called 'robot'"]
    origins = [joint.origin for joint in joints] + [body.origin for body in inertials.values() if body]
    if root.get("version", "1.0").strip() == "1.0" and any(origin.quaternion for origin in origins):
        notes.append(
            "quat_xyzw is read as a rotation, though the file does not say version 1.1: others ignore it"
        )
    notes += [*_reversed_limits(root), *unread_words(root)]
    shapes = tuple(
        link.get("name", "")
        for link in root.findall("link")
        if link.find("collision") is not None
        and link.find("inertial") is None
        and link.find("visual") is None
    )
    return UrdfRobot(root.get("name") or "robot", base, inertials, tuple(joints), tuple(notes), shapes=shapes)


Made = TypeVar("Made")


def _each(root: Element, tag: str, read: Callable[[Element], Made], problems: list[str]) -> list[Made]:
    """Every element of that name; faults go to `problems`, under the element's name."""
    found = []
    for element in root.findall(tag):
        try:
            found.append(read(element))
        except ValueError as error:
            problems.append(f"{tag} '{element.get('name', '')}': {error}")
    return found


def _refuse(problems: Sequence[str], source: str, hint: str) -> None:
    if problems:
        raise InputError(f"{source}: {limits.joined(problems)}", hint)


def _refuse_sizes(root: Element, source: str) -> None:
    for tag in ("link", "joint"):
        count = len(root.findall(tag))
        if count > limits.MAX_LINKS:
            raise InputError(
                f"{source}: {count} {tag}s, psdmc reads at most {limits.MAX_LINKS}",
                "merge links that fixed joints hold together, or leave out what the chain does not need",
            )


def _reversed_limits(root: Element) -> Iterator[str]:
    """A warning for each joint whose lower position limit is above its upper one."""
    for joint in root.findall("joint"):
        element = only(joint, "limit")
        lower, upper = (number(element, name, 0.0, limits.ANY) for name in ("lower", "upper"))
        kind = joint.get("type", "")
        if lower > upper and kind in MOVABLE and URDF_TYPES[kind].about_z and kind != "continuous":
            name = limits.shown(joint.get("name", ""))
            said = f"<limit> lower {lower:g} is above upper {upper:g}"
            yield f"{WARNING}joint {name}: {said}, so psdmc uses neither: exchange them"


def _inertial(link: Element) -> UrdfInertial | None:
    _raise(link_faults(link))
    element = only(link, "inertial")
    if element is None:
        return None
    mass = required_number(only(element, "mass"), "mass", "value", limits.MASS)
    inertia = only(element, "inertia")
    six = tuple(required_number(inertia, "inertia", f"i{name}", limits.INERTIA) for name in INERTIA_NAMES)
    if mass < 0.0:
        raise ValueError(f"<mass> is {mass:g} kg, expected no less than zero")
    return UrdfInertial(mass, six, _origin(element))


def _joint(element: Element) -> UrdfJoint:
    _raise(joint_faults(element))
    kind = element.get("type", "")
    dynamics = only(element, "dynamics")
    for name in () if dynamics is None else dynamics.attrib:
        number(dynamics, name, 0.0, limits.ANY)
    return UrdfJoint(
        name=element.get("name", ""),
        type=kind,
        parent=_link_of(element, "parent"),
        child=_link_of(element, "child"),
        origin=_origin(element),
        axis=_axis(element, kind),
        limits=_limits(element, kind),
        mimic=_mimic(element),
        has_dynamics=has_dynamics(element),
    )


def _raise(faults: Sequence[str]) -> None:
    if faults:
        raise ValueError(limits.joined(faults))


def _axis(joint: Element, kind: str) -> Triple:
    element = only(joint, "axis")
    if element is not None and element.get("xyz") is None:
        raise ValueError("<axis> has no xyz")
    x, y, z = numbers(element, "xyz", (1.0, 0.0, 0.0), limits.DIRECTION)
    if kind not in MOVABLE or not (URDF_TYPES[kind].follows_axis or URDF_TYPES[kind].only_axis is not None):
        return (x, y, z)
    if not any((x, y, z)):
        raise ValueError("<axis> is zero, expected a direction")
    fault = limits.AXIS_LENGTH.fault(math.hypot(x, y, z))
    if fault:
        raise ValueError(f"length of <axis>, {math.hypot(x, y, z):g}, {fault}")
    return (x, y, z)


def _origin(parent: Element) -> Origin:
    element = only(parent, "origin")
    x, y, z = numbers(element, "xyz", (0.0, 0.0, 0.0), limits.LENGTH)
    roll, pitch, yaw = numbers(element, "rpy", (0.0, 0.0, 0.0), limits.ANGLE)
    if element is None or element.get("quat_xyzw") is None:
        return Origin((x, y, z), (roll, pitch, yaw))
    if element.get("rpy") is not None:
        raise ValueError("<origin> has both rpy and quat_xyzw, expected one of them")
    quaternion = numbers(element, "quat_xyzw", (0.0, 0.0, 0.0, 1.0), limits.QUATERNION)
    length = math.hypot(*quaternion)
    if abs(length - 1.0) > UNIT_SLACK:
        raise ValueError(f"<origin> quat_xyzw has length {length:.6g}, expected one")
    i, j, k, w = (part / length for part in quaternion)
    return Origin((x, y, z), quaternion=(i, j, k, w))


def _link_of(joint: Element, tag: str) -> str:
    element = only(joint, tag)
    if element is None or element.get("link") is None:
        raise ValueError(f"<{tag} link=...> is missing")
    return element.get("link", "")


def _mimic(joint: Element) -> Mimic | None:
    element = only(joint, "mimic")
    if element is None:
        return None
    factor = number(element, "multiplier", 1.0, limits.ANY)
    return Mimic(element.get("joint", ""), factor, number(element, "offset", 0.0, limits.ANY))


def _limits(joint: Element, kind: str) -> Limits:
    """The joint's limits; position limits only where the file gives one, as URDF's default, 0 to 0, would be a joint
    that cannot move. A joint of several coordinates has none: a URDF does not say which of them it means; and none
    where the lower one is above the upper one, which _reversed_limits notes."""
    element = only(joint, "limit")
    if element is None:
        return Limits()
    speed, effort, acceleration = (
        number(element, name, math.inf, limits.ANY, is_magnitude=True)
        for name in ("velocity", "effort", "acceleration")
    )
    written = element.get("lower") is not None or element.get("upper") is not None
    lower, upper = (number(element, name, 0.0, limits.ANY) for name in ("lower", "upper"))
    if kind in MOVABLE and not URDF_TYPES[kind].about_z:
        return Limits()
    if kind == "continuous" or not written or lower > upper:
        return Limits(speed=speed, effort=effort, acceleration=acceleration)
    return Limits(lower=lower, upper=upper, speed=speed, effort=effort, acceleration=acceleration)


Ends = tuple[str, str, str]
"""A joint's name, its parent link and its child link."""


def tree_faults(links: Sequence[str], joints: Sequence[Ends]) -> list[str]:
    """Return the reasons why the links of a URDF do not form one tree, one sentence for each."""
    known = dict.fromkeys(links)
    faults = []
    parents: dict[str, list[str]] = {}
    for name, parent, child in joints:
        for role, link in (("parent", parent), ("child", child)):
            if link not in known:
                faults.append(f"joint '{name}': {role} link {shown(link)} does not exist")
        parents.setdefault(child, []).append(name)
    for link, above in parents.items():
        if len(above) > 1:
            quoted = " and ".join(f"'{name}'" for name in above)
            faults.append(f"link '{link}' is the child of joints {quoted}: a loop")
    roots = [name for name in links if name not in parents]
    if not faults and len(roots) > 1:
        faults.append(f"links {listed(roots)} all have no parent joint")
    return faults or _cycle_faults(links, joints, roots)


def _cycle_faults(links: Sequence[str], joints: Sequence[Ends], roots: Sequence[str]) -> list[str]:
    """Faults of links that no root reaches: they form a ring."""
    below: dict[str, list[str]] = {}
    for _, parent, child in joints:
        below.setdefault(parent, []).append(child)
    reached = dict.fromkeys(roots)
    queue = list(roots)
    while queue:
        for child in below.get(queue.pop(), []):
            reached[child] = None
            queue.append(child)
    ring = [name for name in links if name not in reached]
    return [f"links {listed(ring)} form a loop"] if ring else []
