"""Lists the elements and attributes of a URDF that psdmc reads, that it accepts without reading, and that it rejects.

psdmc does not read a misspelt or misplaced word, which would change the dynamics without a message. So within elements
that affect the dynamics, psdmc rejects every unknown word. Elsewhere it rejects words that resemble a known one, and
prints a note for all others. psdmc itself adds words to a URDF made from an MJCF.
"""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches
from functools import lru_cache
from xml.etree.ElementTree import Element

from psdmc.errors import InputError
from psdmc.robot.draft import Draft
from psdmc.robot.inertia import INERTIA_NAMES
from psdmc.robot.joints import FREE, SPHERICAL
from psdmc.robot.limits import DRIVE_INERTIA, MAX_UNKNOWN, shown, words
from psdmc.robot.mechanism import DRIVE as DRIVE_PLACE
from psdmc.robot.xml_text import number, parse_xml

VERSIONS = ("1.0", "1.1", "1.2")
"""1.1 adds quat_xyzw and capsules, 1.2 limits of acceleration; all that dynamics needs of them is read."""

ATTRIBUTES = {
    "inertial": (),
    "mass": ("value",),
    "inertia": tuple(f"i{name}" for name in INERTIA_NAMES),
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "axis": ("xyz",),
    "parent": ("link",),
    "child": ("link",),
}
"""Elements that carry dynamics, each with all the attributes that it may have."""

READ = {"link": ("inertial",), "joint": ("origin", "parent", "child", "axis", "limit", "mimic", "dynamics")}
"""Children of links and joints that concern dynamics; each occurs once at most."""

BESIDE = {
    "robot": ("link", "joint", "material", "gazebo", "transmission", "ros2_control", "sensor", "mujoco"),
    "link": (
        "visual",
        "collision",
        "collision_checking",
        "contact",
        "self_collision_checking",
        "sensor",
        "surface",
    ),
    "joint": ("calibration", "safety_controller"),
}
"""Known children that do not concern a serial arm's dynamics."""

CARRIERS = (
    "link",
    "joint",
    "inertial",
    "mass",
    "inertia",
    "axis",
    "parent",
    "child",
    "limit",
    "mimic",
    "dynamics",
)
"""Elements that carry dynamics: a child elsewhere with such a name, or a similar one, is misspelt or misplaced."""

LIKENESS = 0.75
"""Ratio of difflib above which a word counts as a misspelling: 'inertail' and 'inertial' have 0.88."""

LONGER = 4
"""Largest difference in letters between a word and the one that it is taken for."""

MOST_NOTED = 12
"""Largest number of kinds of unread elements in notes."""


def link_faults(link: Element) -> list[str]:
    """Return a sentence for each word in a <link> element that is not allowed there."""
    inertial = link.find("inertial")
    return [*_children_faults(link, "link"), *([] if inertial is None else _strict_faults(inertial))]


def joint_faults(joint: Element) -> list[str]:
    """Return a sentence for each word in a <joint> element that is not allowed there."""
    inside = [child for child in joint if child.tag in ("origin", "axis", "parent", "child")]
    return [
        *_children_faults(joint, "joint"),
        *(fault for child in inside for fault in _strict_faults(child)),
    ]


def robot_faults(root: Element) -> list[str]:
    """Return a sentence for each word directly in <robot> that is not allowed, or an unknown version."""
    version = " ".join(words(root.get("version", "1.0")))
    faults = [] if version in VERSIONS else [f"version {shown(version)} is not supported"]
    if len(_unknown(root)) > MAX_UNKNOWN:
        return [
            *faults,
            f"{len(_unknown(root))} different unknown elements, psdmc reads at most {MAX_UNKNOWN}",
        ]
    return [*faults, *_children_faults(root, "robot")]


def unread_words(root: Element) -> list[str]:
    """Return a note for each kind of element or attribute that psdmc neither reads nor recognises as harmless."""
    found = _unknown(root)
    more = (
        [f"{len(found) - MOST_NOTED} more kinds of elements are not read"] if len(found) > MOST_NOTED else []
    )
    return [*(f"<{_short(tag)}> in <{kind}> is not read" for kind, tag in found[:MOST_NOTED]), *more]


def _unknown(root: Element) -> list[tuple[str, str]]:
    """Each kind of element that is neither read nor known to be harmless, with the one that it stands in."""
    return list(
        dict.fromkeys(
            (parent.tag, child.tag)
            for parent in [root, *root.findall("link"), *root.findall("joint")]
            for child in parent
            if not _is_foreign(child.tag)
            and child.tag not in (*READ.get(parent.tag, ()), *BESIDE[parent.tag])
        )
    )


def has_dynamics(joint: Element) -> bool:
    """Return whether the <dynamics> element of a joint contains damping, friction or a spring."""
    return any(
        letter in "123456789"
        for dynamics in joint.findall("dynamics")
        for letter in "".join(dynamics.attrib.values())
    )


def _children_faults(parent: Element, kind: str) -> list[str]:
    """Children that look like one that carries dynamics but are none of the parent's own."""
    allowed = (*READ.get(kind, ()), *BESIDE[kind])
    faults = []
    for child in parent:
        if _is_foreign(child.tag) or child.tag in allowed:
            continue
        meant = _meant(child.tag, kind)
        if meant:
            where = f"did you mean <{meant}>?" if meant in allowed else "it does not belong there"
            faults.append(f"unknown element <{_short(child.tag)}> in <{kind}>: {where}")
    return faults


@lru_cache(maxsize=4 * MAX_UNKNOWN)
def _meant(tag: str, kind: str) -> str | None:
    """The word that carries dynamics and is similar to this one; <origin> counts in joints and inertials only."""
    words_known = (*CARRIERS, "origin") if kind == "joint" else CARRIERS
    near = [word for word in words_known if abs(len(word) - len(tag)) <= LONGER]
    return next(iter(get_close_matches(tag.lower(), near, 1, LIKENESS)), None) if near else None


def _strict_faults(element: Element) -> list[str]:
    """Unknown attributes and children of an element that carries dynamics, at any depth."""
    faults = []
    known = ATTRIBUTES.get(element.tag, ())
    for name in element.attrib:
        if name not in known and not _is_foreign(name):
            listed = ", ".join(known) or "none"
            faults.append(f"<{element.tag}> has an unknown attribute '{_short(name)}' (known: {listed})")
    children = ("origin", "mass", "inertia") if element.tag == "inertial" else ()
    for child in element:
        if child.tag in children:
            faults += _strict_faults(child)
        elif not _is_foreign(child.tag):
            faults.append(f"unknown element <{_short(child.tag)}> in <{element.tag}>")
    return faults


def _short(name: str) -> str:
    return name if len(name) <= 40 else f"{name[:40]}..."


def _is_foreign(name: str) -> bool:
    """Whether a name belongs to another vocabulary (it has a name space), or to a comment."""
    return not isinstance(name, str) or name.startswith("{") or ":" in name


# psdmc's own words in a URDF made from an MJCF: drive inertias, ball joints and notes. They are in an XML name space that
# other readers ignore.
SPACE = "urn:psdmc:source"
DRIVE = f"{{{SPACE}}}drive"
"""Of a <joint>: inertia, kg m^2 (kg), of its drive."""
BALL = f"{{{SPACE}}}ball"
"""Of a floating <joint>: it turns about every axis, and stays where it is."""
STANDS_FOR_BALL = FREE.urdf_words[0]
"""The type that URDF has for it."""
MJCF = f"{{{SPACE}}}mjcf"
"""Of the <robot>: the MJCF of the same tree, as MuJoCo compiled it (psdmc/robot/mjcf/to_urdf.py)."""
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
        found = {
            joint.get("name", ""): number(joint.find(DRIVE), "inertia", 0.0, DRIVE_INERTIA, is_magnitude=True)
            for joint in root.findall("joint")
        }
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
