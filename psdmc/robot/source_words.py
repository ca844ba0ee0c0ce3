"""Reads the XML elements and attributes that psdmc adds to a URDF made from an MJCF: drive inertias, ball joints and
notes. They are in an XML name space that other readers ignore."""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import Element

from psdmc.errors import InputError
from psdmc.robot.draft import Draft
from psdmc.robot.joints import FREE, SPHERICAL
from psdmc.robot.limits import DRIVE_INERTIA
from psdmc.robot.mechanism import DRIVE as DRIVE_PLACE
from psdmc.robot.xml_text import number, parse_xml

SPACE = "urn:psdmc:source"
DRIVE = f"{{{SPACE}}}drive"
"""Of a <joint>: inertia, kg m^2 (kg), of its drive."""
BALL = f"{{{SPACE}}}ball"
"""Of a floating <joint>: it turns about every axis, and stays where it is."""
STANDS_FOR_BALL = FREE.urdf_words[0]
"""The type that URDF has for it."""
MJCF = f"{{{SPACE}}}mjcf"
"""Of the <robot>: the MJCF of the same tree, as MuJoCo compiled it (psdmc/robot/mjcf_text.py)."""
NOTE = f"{{{SPACE}}}note"
"""Of the <robot>: text, one sentence for `show`."""

MOST_NOTES = 100


def with_source_words(draft: Draft, text: str, source: str) -> Draft:
    """Return the robot with the drive inertias, ball joints and notes that psdmc wrote into the URDF. Raises InputError
    if one of their numbers is wrong."""
    if SPACE not in text:
        return draft
    root = parse_xml(text, source, "robot")
    try:
        found = {joint.get("name", ""): _drive(joint) for joint in root.findall("joint")}
    except ValueError as error:
        raise InputError(f"{source}: {error}", "derive the robot again from its own file") from None
    drives = {name: inertia for name, inertia in found.items() if inertia}
    notes = [" ".join(note.get("text", "").split()) for note in root.findall(NOTE)[:MOST_NOTES]]
    parameters = []
    for joint, own in zip(draft.joints, draft.parameters, strict=True):
        values = own.copy()
        values[DRIVE_PLACE] += drives.get(joint.name, 0.0)
        parameters.append(values)
    has_drive = tuple(
        drive or joint.name in drives for drive, joint in zip(draft.drives, draft.joints, strict=True)
    )
    balls = ball_names(root)
    joints = tuple(replace(own, type=SPHERICAL) if own.name in balls else own for own in draft.joints)
    return replace(
        draft, joints=joints, parameters=tuple(parameters), drives=has_drive, notes=(*notes, *draft.notes)
    )


def ball_names(robot: Element) -> tuple[str, ...]:
    """Return the names of the joints that psdmc marked as ball joints in a URDF."""
    return tuple(
        joint.get("name", "")
        for joint in robot.findall("joint")
        if joint.find(BALL) is not None and joint.get("type") == STANDS_FOR_BALL
    )


def _drive(joint: Element) -> float:
    return number(joint.find(DRIVE), "inertia", 0.0, DRIVE_INERTIA, is_magnitude=True)
