"""A URDF as plain data, every number checked: what it says, before any of it is a chain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from psdmc.errors import InputError
from psdmc.robot.chain import Limits
from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.names import naming_faults
from psdmc.robot.xml_text import number, numbers, parse_xml, required_number

Triple = tuple[float, float, float]

MOVABLE = ("revolute", "continuous", "prismatic")
"""Joint types that psdmc models; fixed ones are merged, all others refused on the chain."""


@dataclass(frozen=True, slots=True)
class UrdfInertial:
    """mass kg; inertia kg m^2 (INERTIA_NAMES) about the centre of mass, along the inertial frame's axes."""

    mass: float
    inertia: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """One <joint>. xyz (m) and rpy (rad) place the child link in the parent at q = 0; axis in the child."""

    name: str
    type: str
    parent: str
    child: str
    xyz: Triple
    rpy: Triple
    axis: Triple
    limits: Limits
    is_mimic: bool

    @property
    def is_movable(self) -> bool:
        return self.type != "fixed"


@dataclass(frozen=True, slots=True)
class UrdfRobot:
    """A tree of links. `inertials` has every link in the file's order, None where it has no <inertial>."""

    name: str
    root: str
    inertials: dict[str, UrdfInertial | None]
    joints: tuple[UrdfJoint, ...]

    def joints_below(self, link: str) -> tuple[UrdfJoint, ...]:
        return tuple(joint for joint in self.joints if joint.parent == link)


def read_urdf(text: str, source: str) -> UrdfRobot:
    """The file's content; InputError names everything that is wrong with its links and joints at once."""
    root = parse_xml(text, source, "robot")
    problems: list[str] = []
    for tag in ("link", "joint"):
        problems += naming_faults([element.get("name", "") for element in root.findall(tag)], tag)
    _refuse(problems, source, "names tell links and joints apart: correct them")
    inertials: dict[str, UrdfInertial | None] = {}
    joints: list[UrdfJoint] = []
    for element in root.findall("link"):
        try:
            inertials[element.get("name", "")] = _inertial(element)
        except ValueError as error:
            problems.append(f"link '{element.get('name', '')}': {error}")
    for element in root.findall("joint"):
        try:
            joints.append(_joint(element))
        except ValueError as error:
            problems.append(f"joint '{element.get('name', '')}': {error}")
    _refuse(problems, source, "correct the file")
    if not inertials:
        raise InputError(f"{source}: no <link> in it", "give a URDF with links and joints")
    _refuse(_tree_faults(inertials, joints), source, "a robot is a tree: one root, one parent joint per link")
    children = {joint.child for joint in joints}
    base = next(name for name in inertials if name not in children)
    return UrdfRobot(root.get("name", "robot"), base, inertials, tuple(joints))


def _refuse(problems: Sequence[str], source: str, hint: str) -> None:
    if problems:
        raise InputError(f"{source}: " + "; ".join(problems), hint)


def _inertial(link: Element) -> UrdfInertial | None:
    element = link.find("inertial")
    if element is None:
        return None
    numbers(element.find("origin"), "xyz", (0.0, 0.0, 0.0))
    numbers(element.find("origin"), "rpy", (0.0, 0.0, 0.0))
    mass = required_number(element.find("mass"), "mass", "value")
    inertia = element.find("inertia")
    six = tuple(required_number(inertia, "inertia", f"i{name}") for name in INERTIA_NAMES)
    if mass < 0.0:
        raise ValueError(f"<mass> is {mass:g} kg, expected no less than zero")
    return UrdfInertial(mass, six)


def _joint(element: Element) -> UrdfJoint:
    kind = element.get("type", "")
    axis = numbers(element.find("axis"), "xyz", (1.0, 0.0, 0.0))
    if kind in (*MOVABLE, "planar") and not any(axis):
        raise ValueError("<axis> is zero, expected a direction")
    origin = element.find("origin")
    x, y, z = numbers(origin, "xyz", (0.0, 0.0, 0.0))
    roll, pitch, yaw = numbers(origin, "rpy", (0.0, 0.0, 0.0))
    return UrdfJoint(
        name=element.get("name", ""),
        type=kind,
        parent=_link_of(element, "parent"),
        child=_link_of(element, "child"),
        xyz=(x, y, z),
        rpy=(roll, pitch, yaw),
        axis=(axis[0], axis[1], axis[2]),
        limits=_limits(element, kind),
        is_mimic=element.find("mimic") is not None,
    )


def _link_of(joint: Element, tag: str) -> str:
    element = joint.find(tag)
    if element is None or element.get("link") is None:
        raise ValueError(f"<{tag} link=...> is missing")
    return element.get("link", "")


def _limits(joint: Element, kind: str) -> Limits:
    """Position limits only where the file writes one: URDF's default, 0 to 0, would be a joint stuck."""
    element = joint.find("limit")
    if element is None:
        return Limits()
    speed = number(element, "velocity", math.inf)
    effort = number(element, "effort", math.inf)
    written = element.get("lower") is not None or element.get("upper") is not None
    lower, upper = number(element, "lower", 0.0), number(element, "upper", 0.0)
    if kind == "continuous" or not written:
        return Limits(speed=speed, effort=effort)
    if lower > upper:
        raise ValueError(f"<limit> lower {lower:g} is above upper {upper:g}")
    return Limits(lower=lower, upper=upper, speed=speed, effort=effort)


def _tree_faults(links: dict[str, UrdfInertial | None], joints: Sequence[UrdfJoint]) -> list[str]:
    faults = []
    for joint in joints:
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                faults.append(f"joint '{joint.name}': {role} link '{link}' does not exist")
    parents: dict[str, list[str]] = {}
    for joint in joints:
        parents.setdefault(joint.child, []).append(joint.name)
    for link, above in parents.items():
        if len(above) > 1:
            quoted = " and ".join(f"'{name}'" for name in above)
            faults.append(f"link '{link}' is the child of joints {quoted}: a loop")
    roots = [name for name in links if name not in parents]
    if not faults and len(roots) > 1:
        faults.append("links " + ", ".join(f"'{name}'" for name in roots) + " all have no parent joint")
    return faults or _cycle_faults(links, joints, roots)


def _cycle_faults(
    links: dict[str, UrdfInertial | None], joints: Sequence[UrdfJoint], roots: Sequence[str]
) -> list[str]:
    """Links that no root reaches hang in a ring."""
    below: dict[str, list[str]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint.child)
    reached = dict.fromkeys(roots)
    queue = list(roots)
    while queue:
        for child in below.get(queue.pop(), []):
            reached[child] = None
            queue.append(child)
    ring = [name for name in links if name not in reached]
    return ["links " + ", ".join(f"'{name}'" for name in ring) + " form a loop"] if ring else []
