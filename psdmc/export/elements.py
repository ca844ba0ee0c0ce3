"""Makes the XML elements of a URDF file, such as <inertial> and <limit>, and a whole file without shapes.

A program that reads a number from the text gets exactly equal floats.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from psdmc.export.bodies import WORLD, Body, JointFriction, Written
from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.mechanism import BASE, Array, Limits, NamedFrame, Placement

MUJOCO = {
    "balanceinertia": "false",
    "boundmass": "0",
    "boundinertia": "0",
    "inertiafromgeom": "false",
    "fusestatic": "true",
}
"""What MuJoCo must be told in a URDF so that links without <inertial> get no mass from their shapes; other readers pass
over it."""

QUARTER = 1e-9
"""Cosine of the pitch below which roll and yaw turn about the same axis."""


def exact(values: Iterable[float]) -> str:
    """Return numbers as text with as many digits as are needed to read equal floats. Minus zero is written as zero."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def roll_pitch_yaw_of(rotation: Array) -> tuple[float, float, float]:
    """Return roll, pitch, yaw (rad) of Rz(yaw) Ry(pitch) Rx(roll). If the pitch is a right angle, roll is 0."""
    across = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], across)
    if across < QUARTER:
        return (0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1]))
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    return (roll, pitch, math.atan2(rotation[1, 0], rotation[0, 0]))


def inertial_element(body: Body) -> Element | None:
    """Return the element <inertial> of a link, with the inertia about the centre of mass, along the link's axes. Return
    None if the link has no mass."""
    if body.inertial is None:
        return None
    mass, com, six = body.inertial
    element = Element("inertial")
    SubElement(element, "origin", xyz=exact(com), rpy="0 0 0")
    SubElement(element, "mass", value=exact([mass]))
    SubElement(
        element, "inertia", {f"i{name}": exact([v]) for name, v in zip(INERTIA_NAMES, six, strict=True)}
    )
    return element


def origin_element(place: Placement) -> Element:
    """Return the element <origin> of a placement."""
    return Element("origin", xyz=exact(place.translation), rpy=exact(roll_pitch_yaw_of(place.rotation)))


def dynamics_element(friction: JointFriction) -> Element:
    """Return the element <dynamics> with the given damping and constant friction of a joint."""
    return Element("dynamics", damping=exact([friction.damping]), friction=exact([friction.constant]))


def limit_element(limits: Limits) -> Element:
    """Return the element <limit> with the given limits of a joint.

    URDF requires effort and velocity. If the robot has no limit of effort or velocity, 1e30 is written: psdmc and
    Pinocchio would read a zero as a limit of zero.
    """
    given = {"effort": limits.effort, "velocity": limits.speed, "acceleration": limits.acceleration}
    given |= {"lower": limits.lower, "upper": limits.upper}
    required = {"effort", "velocity"}
    finite = {
        name: exact([value if math.isfinite(value) else math.copysign(LARGEST, value)])
        for name, value in given.items()
        if math.isfinite(value) or name in required
    }
    return Element("limit", finite)


LARGEST = 1e30
"""Stands for no limit where URDF requires one."""


def joint_word(body: Body) -> str:
    """Return the type of a joint in URDF, such as 'revolute', or 'continuous' for a joint without position limits."""
    limits = body.joint.limits
    endless = math.isinf(limits.lower) and math.isinf(limits.upper)
    return body.joint.type.urdf_words[-1 if endless else 0]


def fixed_link(robot: Element, frame: NamedFrame, parent: str) -> None:
    """Add a massless link to the robot, fixed to the link `parent` at the placement of a frame."""
    SubElement(robot, "link", name=frame.name)
    fixed_joint(robot, frame.name, parent, frame.placement)


def fixed_joint(robot: Element, child: str, parent: str, place: Placement) -> None:
    """Add a fixed joint to the robot. The joint's name is the child link's name with `_fixed` appended. Underscores are
    added if another joint has this name."""
    name, used = f"{child}_fixed", {joint.get("name") for joint in robot.findall("joint")}
    while name in used:
        name += "_"
    joint = SubElement(robot, "joint", name=name, type="fixed")
    joint.append(origin_element(place))
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)


def put_on_world(robot: Element, what: Written) -> None:
    """Attach the base to a new link whose z axis points against gravity, unless the base's own does."""
    if what.world is None:
        return
    name, used = WORLD, {link.get("name") for link in robot.findall("link")}
    while name in used:
        name += "_"
    robot.insert(0, Element("link", name=name))
    fixed_joint(robot, what.base, name, what.world)


def as_text(robot: Element) -> str:
    """Return the text of the URDF file, with all names escaped."""
    indent(robot)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(robot, encoding="unicode") + "\n"


def urdf_of(what: Written) -> Element:
    """Return the element <robot> of a URDF, which contains all links, joints and named frames of the robot."""
    robot = Element("robot", name=what.name, version="1.0")
    SubElement(SubElement(robot, "mujoco"), "compiler", MUJOCO)
    SubElement(robot, "link", name=what.base)
    for body in what.bodies:
        link = SubElement(robot, "link", name=body.name)
        inertial = inertial_element(body)
        if inertial is not None:
            link.append(inertial)
        robot.append(joint_element(body, what))
    for frame in what.frames:
        fixed_link(robot, frame, what.bodies[frame.joint].name)
    put_on_world(robot, what)
    return robot


def joint_element(body: Body, what: Written) -> Element:
    """Return the element <joint> of the joint that moves a body."""
    joint = Element("joint", name=body.joint.name, type=joint_word(body))
    joint.append(origin_element(body.origin))
    SubElement(joint, "parent", link=what.base if body.parent == BASE else what.bodies[body.parent].name)
    SubElement(joint, "child", link=body.name)
    SubElement(joint, "axis", xyz=exact(body.axis))
    joint.append(limit_element(body.joint.limits))
    if body.mimic is not None and body.mimic.leader is not None:
        SubElement(
            joint,
            "mimic",
            joint=what.bodies[body.mimic.leader].joint.name,
            multiplier=exact([body.mimic.ratio]),
            offset=exact([body.mimic.offset]),
        )
    if body.friction is not None:
        joint.append(dynamics_element(body.friction))
    return joint
