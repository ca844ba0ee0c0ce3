"""Writes a URDF from the one of which the model was derived, with new inertias; all else stays unchanged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from psdmc.export.bodies import Body, Written
from psdmc.export.elements import (
    MUJOCO,
    dynamics_element,
    exact,
    fixed_link,
    inertial_element,
    origin_element,
    put_on_world,
)
from psdmc.robot.inertia import physical_fault
from psdmc.robot.limits import shown
from psdmc.robot.mechanism import Placement
from psdmc.robot.urdf.dependent_joints import locked
from psdmc.robot.urdf.read_urdf import UrdfJoint, UrdfRobot, read_urdf
from psdmc.robot.urdf.urdf_draft import place_of
from psdmc.robot.urdf.urdf_words import DRIVE, MJCF
from psdmc.robot.xml_text import parse_xml

STILL = ("axis", "limit", "mimic", "dynamics", "calibration", "safety_controller")
"""Children of a <joint> that have no meaning where it is fixed."""


def urdf_with(what: Written, provenance: Mapping[str, Any]) -> tuple[Element, tuple[str, ...]]:
    """Return the element <robot> of the URDF of which the model was derived, with the new inertias, and sentences about
    the changes. Links above the model's base are left out.

    Joints that the model locks become fixed at their locked positions. If several links move together, the link that
    the joint moves gets their whole mass.
    """
    text, source = provenance["source_text"], str(provenance.get("source_name", "robot"))
    options = provenance["options"]
    robot = locked(read_urdf(text, source), options.get("lock") or {}, source)
    root = parse_xml(text, source, "robot")
    _remove(root, (MJCF,))
    moving = {body.joint.name: body for body in what.bodies}
    kept = _below(robot, what.base)
    notes = [*_dropped(root, kept), *_tell_mujoco(root)]
    still = _still(robot, what.base, moving)
    for link in root.findall("link"):
        if link.get("name", "") not in still:
            _remove(link, ("inertial",))
        elif fault := _still_fault(robot, link.get("name", "")):
            _remove(link, ("inertial",))
            notes.append(fault)
    places = _Places(robot, what, options.get("snap", 0.0))
    by_name = {joint.name: joint for joint in robot.joints}
    for element in root.findall("joint"):
        joint = by_name[element.get("name", "")]
        _remove(element, (DRIVE,))
        if joint.name in moving:
            _move(element, moving[joint.name], places.of_moving(joint))
        else:
            notes += _fix(element, joint, places.of_still(joint))
    for link in root.findall("link"):
        for body in what.bodies:
            if link.get("name") == body.name and (inertial := inertial_element(body)) is not None:
                link.insert(0, inertial)
    for frame in what.frames:
        if frame.name not in kept:
            fixed_link(root, frame, what.bodies[frame.joint].name)
    put_on_world(root, what)
    merged = [name for name in kept if name not in still and name not in {body.name for body in what.bodies}]
    if any(robot.inertials[name] for name in merged):
        notes.append(
            f"the masses of {len(merged)} links that are fixed to others are on those that move them"
        )
    return root, tuple(notes)


def _below(robot: UrdfRobot, base: str) -> dict[str, None]:
    """Links from the base outward. A floating base's world is no link of the file: its one joint has the base below."""
    start = base if base in robot.inertials else robot.root
    kept, queue = {start: None}, [start]
    while queue:
        for joint in robot.joints_below(queue.pop()):
            kept[joint.child] = None
            queue.append(joint.child)
    return kept


def _dropped(root: Element, kept: Mapping[str, None]) -> list[str]:
    """Take out what is not below the base; a note where that is something."""
    gone = [link for link in root.findall("link") if link.get("name", "") not in kept]
    for link in gone:
        root.remove(link)
    for joint in root.findall("joint"):
        child = joint.find("child")
        parent = joint.find("parent")
        if any(end is None or end.get("link", "") not in kept for end in (child, parent)):
            root.remove(joint)
    return [f"{len(gone)} links that are not below the model's base are left out"] if gone else []


def _tell_mujoco(root: Element) -> list[str]:
    extension = root.find("mujoco")
    if extension is None:
        extension = Element("mujoco")
        root.insert(0, extension)
    compiler = extension.find("compiler")
    if compiler is None:
        compiler = SubElement(extension, "compiler")
    changed = [name for name, value in MUJOCO.items() if compiler.get(name, value) != value]
    compiler.attrib.update(MUJOCO)
    return [f"the file's <mujoco> compiler: {', '.join(changed)} changed"] if changed else []


def _still(robot: UrdfRobot, base: str, moving: Mapping[str, Body]) -> set[str]:
    """Links that no joint of the model moves."""
    free = any(not body.joint.type.about_z for body in moving.values())
    if free:
        return set()
    found, queue = {base}, [base]
    while queue:
        for joint in robot.joints_below(queue.pop()):
            if joint.name not in moving:
                found.add(joint.child)
                queue.append(joint.child)
    return found


def _still_fault(robot: UrdfRobot, link: str) -> str:
    """A note where a link that does not move has a body that readers may refuse; it has no part in any torque."""
    inertial = robot.inertials[link]
    fault = inertial and physical_fault(inertial.mass, np.array(inertial.inertia))
    return f"link {shown(link)}, which does not move: {fault}: left out" if fault else ""


class _Places:
    """Where each link's frame goes in that of the link that its joint hangs on.

    Fixed joints keep the file's numbers, snapped as the model's; a moving joint takes up what that leaves to the model's
    own placement.
    """

    def __init__(self, robot: UrdfRobot, what: Written, snap: float) -> None:
        self._snap, self._base = snap, what.base
        self._above = {joint.child: joint for joint in robot.joints}
        self._bodies = {body.joint.name: body for body in what.bodies}

    def of_still(self, joint: UrdfJoint) -> Placement:
        return place_of(joint, self._snap)

    def of_moving(self, joint: UrdfJoint) -> Placement:
        return self._on_body(joint.parent).inverse() @ self._bodies[joint.name].origin

    def _on_body(self, link: str) -> Placement:
        """The link in the frame of the moving link that carries it, or of the base."""
        joint = self._above.get(link)
        if joint is None or joint.name in self._bodies or joint.child == self._base:
            return Placement.identity()
        return self._on_body(joint.parent) @ self.of_still(joint)


def _move(element: Element, body: Body, place: Placement) -> None:
    """Put a moving joint where the model has it."""
    _replace(element, "origin", origin_element(place))
    _replace(element, "axis", Element("axis", xyz=exact(body.axis)))
    if body.friction is not None:
        _replace(element, "dynamics", dynamics_element(body.friction))


def _fix(element: Element, joint: UrdfJoint, place: Placement) -> list[str]:
    """Put a joint that the model does not move where it holds it; a note where the file moves it."""
    kind = element.get("type", "")
    _replace(element, "origin", origin_element(place))
    if kind == "fixed":
        return []
    element.set("type", "fixed")
    _remove(element, STILL)
    return [f"joint {shown(joint.name)}, which the model does not move, is fixed"]


def _replace(parent: Element, tag: str, new: Element) -> None:
    old = parent.find(tag)
    if old is None:
        parent.append(new)
        return
    parent.insert(list(parent).index(old), new)
    parent.remove(old)


def _remove(parent: Element, tags: tuple[str, ...]) -> None:
    for child in list(parent):
        if child.tag in tags:
            parent.remove(child)
