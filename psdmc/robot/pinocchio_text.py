"""A URDF's text as Pinocchio is to read it: dynamics only, and every movable joint with one coordinate."""

from __future__ import annotations

from collections.abc import Collection
from xml.etree.ElementTree import Element, SubElement, tostring

import pinocchio

from psdmc.errors import InputError
from psdmc.robot.xml_text import parse_xml

JOINT_PREFIX = "joint:"
"""Put before every joint's name: Pinocchio cannot lock a joint that shares its name with a link."""


def pinocchio_model(text: str, source: str, movable: Collection[str] | None = None) -> pinocchio.Model:
    """Pinocchio's model of the URDF, joints called JOINT_PREFIX + name.

    movable   names of joints; every other one is fixed, so that its bodies are merged (None: all stay)

    A continuous joint becomes a revolute one (Pinocchio would give it a cosine and a sine), pictures are
    left out (a missing mesh is none of our business). InputError where Pinocchio refuses what is left.
    """
    root = parse_xml(text, source, "robot")
    for link in root.findall("link"):
        for picture in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(picture)
    for joint in root.findall("joint"):
        if movable is not None and joint.get("name") not in movable:
            joint.set("type", "fixed")
        elif joint.get("type") == "continuous":
            joint.set("type", "revolute")
        _complete_limit(joint)
        joint.set("name", JOINT_PREFIX + joint.get("name", ""))
    try:
        return pinocchio.buildModelFromXML(tostring(root, encoding="unicode"))
    except ValueError as error:
        raise InputError(f"{source}: Pinocchio cannot read it: {error}", "check_urdf may say more") from None


def _complete_limit(joint: Element) -> None:
    """Pinocchio refuses a joint without effort and velocity limits, which no dynamics needs."""
    limit = joint.find("limit")
    limit = SubElement(joint, "limit") if limit is None else limit
    for name in ("effort", "velocity"):
        limit.set(name, limit.get(name, "0"))
