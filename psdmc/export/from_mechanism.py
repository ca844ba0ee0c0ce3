"""Writes a URDF for a robot that does not come from a URDF, such as a DH table: links, joints, inertias and limits.
The result has no shapes."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from psdmc.export.bodies import Body, Written
from psdmc.export.elements import (
    MUJOCO,
    dynamics_element,
    fixed_link,
    inertial_element,
    joint_word,
    limit_element,
    origin_element,
    put_on_world,
)
from psdmc.export.numbers import exact
from psdmc.robot.mechanism import BASE


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
    if body.follows is not None and body.follows.leader is not None:
        SubElement(
            joint,
            "mimic",
            joint=what.bodies[body.follows.leader].joint.name,
            multiplier=exact([body.follows.ratio]),
            offset=exact([body.follows.offset]),
        )
    if body.friction is not None:
        joint.append(dynamics_element(body.friction))
    return joint
