"""Parts of a URDF that both ways of writing one share."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from psdmc.export.bodies import WORLD, Body, Written
from psdmc.export.friction import JointFriction
from psdmc.export.numbers import exact, roll_pitch_yaw_of
from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.mechanism import Limits, NamedFrame, Placement

MUJOCO = {
    "balanceinertia": "false",
    "boundmass": "0",
    "boundinertia": "0",
    "inertiafromgeom": "false",
    "fusestatic": "true",
}
"""What MuJoCo must be told in a URDF so that links without <inertial> get no mass from their shapes; other readers pass
over it."""


def inertial_element(body: Body) -> Element | None:
    """<inertial> about the centre of mass along the link's axes; None where the link has no mass."""
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
    """<origin> of a placement."""
    return Element("origin", xyz=exact(place.translation), rpy=exact(roll_pitch_yaw_of(place.rotation)))


def dynamics_element(friction: JointFriction) -> Element:
    """<dynamics> of a joint's friction."""
    return Element("dynamics", damping=exact([friction.damping]), friction=exact([friction.constant]))


def limit_element(limits: Limits) -> Element:
    """<limit>; effort and velocity, which URDF requires, are zero where there are none: psdmc and Pinocchio take zero as
    written, so the largest float stands for none."""
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
    """URDF's type; of two words the last is for a joint without position limits."""
    limits = body.joint.limits
    endless = math.isinf(limits.lower) and math.isinf(limits.upper)
    return body.joint.type.urdf_words[-1 if endless else 0]


def fixed_link(robot: Element, frame: NamedFrame, parent: str) -> None:
    """A link without mass, fixed to another."""
    SubElement(robot, "link", name=frame.name)
    fixed_joint(robot, frame.name, parent, frame.placement)


def fixed_joint(robot: Element, child: str, parent: str, place: Placement) -> None:
    """Add a fixed joint to the robot; its name is the child's, unless another joint has that."""
    joint = SubElement(robot, "joint", name=free_joint_name(robot, f"{child}_fixed"), type="fixed")
    joint.append(origin_element(place))
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)


def free_joint_name(robot: Element, name: str) -> str:
    """The name, with underscores behind it while another joint has it."""
    used = {joint.get("name") for joint in robot.findall("joint")}
    while name in used:
        name += "_"
    return name


def put_on_world(robot: Element, what: Written) -> None:
    """Hang the base on a link whose z points against gravity, where the base's own does not."""
    if what.world is None:
        return
    name, used = WORLD, {link.get("name") for link in robot.findall("link")}
    while name in used:
        name += "_"
    robot.insert(0, Element("link", name=name))
    fixed_joint(robot, what.base, name, what.world)


def as_text(robot: Element) -> str:
    """The file's text, its names escaped."""
    indent(robot)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(robot, encoding="unicode") + "\n"
