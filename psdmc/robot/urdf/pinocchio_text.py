"""Converts a URDF to a text for Pinocchio: links, inertials and joints only, with the digits of the original file.

Elements that do not affect the dynamics are left out, because a mesh may be missing, and urdfdom prints errors about
things that psdmc has accepted. White space around numbers is removed, because urdfdom would read zero.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, tostring

import pinocchio

from psdmc.errors import InputError
from psdmc.robot.limits import words
from psdmc.robot.mechanism import Array
from psdmc.robot.urdf.urdf_words import ATTRIBUTES, ball_names
from psdmc.robot.xml_text import parse_xml

JOINT_PREFIX = "joint\t"
"""Put before every joint's name: Pinocchio cannot lock a joint that shares its name with a link. No name of a file
has a tab in it."""

VERSION = "1.1"
"""The first version with quat_xyzw, which urdfdom ignores in older ones; 1.2 requires limits that older files need not
have."""


def pinocchio_model(
    text: str,
    source: str,
    movable: Collection[str] | None = None,
    kinds: Mapping[str, str] | None = None,
    root_joint: str | None = None,
) -> pinocchio.Model:
    """Return Pinocchio's model of a URDF that read_urdf has accepted. Its joints are called JOINT_PREFIX + name.

    movable     names of joints; all others become fixed, and their bodies are merged (None: all joints stay)
    kinds       joint types of the file -> types that replace them
    root_joint  name of a free joint for the root link (None: the root link is fixed)

    A continuous joint becomes a revolute one, because Pinocchio would use a cosine and a sine as its coordinates.
    Raises InputError if Pinocchio rejects the text.
    """
    root = parse_xml(text, source, "robot")
    wanted = tostring(
        dynamics_of(root, movable, {"continuous": "revolute", **(kinds or {})}), encoding="unicode"
    )
    balls = () if kinds else [JOINT_PREFIX + name for name in ball_names(root)]
    try:
        if root_joint is None:
            return _with_balls(pinocchio.buildModelFromXML(wanted), balls)
        free_flyer = pinocchio.JointModelFreeFlyer()
        return _with_balls(pinocchio.buildModelFromXML(wanted, free_flyer, JOINT_PREFIX + root_joint), balls)
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{source}: Pinocchio cannot read it: {reason}", "check_urdf may say more") from None


def _with_balls(model: pinocchio.Model, balls: Collection[str]) -> pinocchio.Model:
    """The model with these free joints as spherical ones, which no URDF can have."""
    if not balls:
        return model
    found = pinocchio.Model()
    found.name, found.gravity = model.name, model.gravity
    for k in range(1, model.njoints):
        about = pinocchio.JointModelSpherical() if model.names[k] in balls else model.joints[k]
        found.addJoint(model.parents[k], about, model.jointPlacements[k], model.names[k])
        found.inertias[k] = model.inertias[k]
    for frame in list(model.frames)[1:]:
        found.addFrame(frame, False)
    return found


def locked_at(model: pinocchio.Model, held: Mapping[str, float]) -> pinocchio.Model:
    """Return Pinocchio's model with some joints fixed at given positions. The bodies that such a joint connects are
    merged.

    held  positions by joint name, without JOINT_PREFIX
    """
    if not held:
        return model
    q = pinocchio.neutral(model)
    joints = [model.getJointId(JOINT_PREFIX + name) for name in held]
    for joint, value in zip(joints, held.values(), strict=True):
        if model.joints[joint].nq == 1:
            q[model.joints[joint].idx_q] = value
    return reduced(model, joints, q)


def reduced(model: pinocchio.Model, joints: Sequence[int], q: Array) -> pinocchio.Model:
    """Return Pinocchio's model with some joints fixed at their positions in q.

    Pinocchio gives a frame of a fixed joint a wrong parent: the frame itself. This function restores the right parents.
    """
    found = pinocchio.buildReducedModel(model, list(joints), q)
    number = {_key(frame): k for k, frame in enumerate(found.frames)}
    for frame in model.frames:
        above = model.frames[frame.parentFrame]
        found.frames[number[_key(frame)]].parentFrame = number[_key(above)]
    return found


def _key(frame: pinocchio.Frame) -> tuple[str, bool]:
    """Links and joints may share their names."""
    return frame.name, frame.type == pinocchio.FrameType.BODY


def dynamics_of(root: Element, movable: Collection[str] | None, kinds: Mapping[str, str]) -> Element:
    """Return a <robot> element with only those elements and attributes that affect the dynamics, without white space
    around numbers. The arguments are those of pinocchio_model."""
    robot = Element("robot", name=root.get("name") or "robot", version=VERSION)
    for link in root.findall("link"):
        copy = SubElement(robot, "link", name=link.get("name", ""))
        inertial = link.find("inertial")
        if inertial is not None:
            _copy(inertial, SubElement(copy, "inertial"), ("origin", "mass", "inertia"))
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        is_locked = movable is not None and name not in movable
        copy = SubElement(
            robot, "joint", name=JOINT_PREFIX + name, type="fixed" if is_locked else kinds.get(kind, kind)
        )
        _copy(joint, copy, ("origin", "parent", "child", "axis"))
        # Pinocchio refuses a joint without these limits, which no dynamics needs.
        SubElement(copy, "limit", effort="0", velocity="0")
    return robot


def _copy(element: Element, target: Element, tags: Collection[str]) -> None:
    """Children with the attributes that carry dynamics, white space around numbers made one blank."""
    for child in element:
        if child.tag in tags:
            kept = {name: child.attrib[name] for name in ATTRIBUTES[child.tag] if name in child.attrib}
            trimmed = {name: text if name == "link" else " ".join(words(text)) for name, text in kept.items()}
            SubElement(target, child.tag, trimmed)
