"""URDFs: attributes, numbers, elements."""

from __future__ import annotations

import copy
from random import Random
from xml.etree.ElementTree import Element, ParseError, fromstring, tostring

from mutate_bytes import mutate_bytes, mutate_lines
from nasty import near, number, text

TAGS = ("link", "joint", "inertial", "mass", "inertia", "origin", "axis", "limit", "mimic", "parent", "child",
        "dynamics", "transmission", "gazebo", "visual", "xacro:macro", "robot", "safety_controller")  # fmt: skip
ATTRIBUTES = ("name", "type", "xyz", "rpy", "quat_xyzw", "value", "ixx", "ixy", "izz", "link", "lower", "upper",
              "velocity", "effort", "joint", "multiplier", "offset", "version", "damping", "XYZ")  # fmt: skip
TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar", "spherical", "")
MOST_COPIES = 40


def mutate_xml(data: bytes, rng: Random) -> bytes:
    kind = rng.random()
    if kind < 0.05:
        return mutate_bytes(data, rng)
    if kind < 0.15:
        return mutate_lines(data, rng)
    try:
        root = fromstring(data)
    except (ParseError, ValueError, LookupError):
        return mutate_lines(data, rng)
    for _ in range(rng.choice((1, 1, 1, 2, 2, 4))):
        rng.choice(_EDITS)(root, rng)
    try:
        return tostring(root, encoding="utf-8")
    except (TypeError, ValueError):
        return mutate_bytes(data, rng)


def _pick(root: Element, rng: Random) -> Element:
    return rng.choice(list(root.iter()))


def _pick_with_attributes(root: Element, rng: Random) -> Element:
    return rng.choice([element for element in root.iter() if element.attrib] or [root])


def _number(root: Element, rng: Random) -> None:
    """One number of one attribute."""
    element = _pick_with_attributes(root, rng)
    numeric = [name for name, value in element.attrib.items() if any(c.isdigit() for c in value)]
    if not numeric:
        return
    name = rng.choice(numeric)
    words = element.attrib[name].split() or [""]
    at = rng.randrange(len(words))
    words[at] = near(words[at], rng)
    element.set(name, rng.choice((" ", " ", " ", "  ", "\t", "\u00a0", ",")).join(words))


def _attribute(root: Element, rng: Random) -> None:
    """Set, drop, rename or copy an attribute."""
    element = _pick_with_attributes(root, rng)
    name = rng.choice(list(element.attrib) or ["name"])
    choice = rng.randrange(5)
    if choice == 0:
        element.set(name, text(rng))
    elif choice == 1:
        element.attrib.pop(name, None)
    elif choice == 2:
        element.set(rng.choice(ATTRIBUTES), element.attrib.pop(name, ""))
    elif choice == 3:
        element.set(name, _pick_with_attributes(root, rng).get(name, ""))
    else:
        element.set(rng.choice(ATTRIBUTES), rng.choice((number, text))(rng))


def _type(root: Element, rng: Random) -> None:
    joints = root.findall("joint")
    if joints:
        rng.choice(joints).set("type", rng.choice(TYPES))


def _drop(root: Element, rng: Random) -> None:
    parent = _pick(root, rng)
    if len(parent):
        parent.remove(rng.choice(list(parent)))


def _repeat(root: Element, rng: Random) -> None:
    parent = _pick(root, rng)
    if len(parent):
        child = rng.choice(list(parent))
        times = MOST_COPIES if rng.random() < 0.05 else 1
        for _ in range(times):
            parent.insert(rng.randrange(len(parent) + 1), copy.deepcopy(child))


def _move(root: Element, rng: Random) -> None:
    target, source = _pick(root, rng), _pick(root, rng)
    if len(source):
        child = rng.choice(list(source))
        if target not in list(child.iter()):
            source.remove(child)
            target.append(child)


def _tag(root: Element, rng: Random) -> None:
    _pick(root, rng).tag = rng.choice((*TAGS, "a"))


def _text(root: Element, rng: Random) -> None:
    _pick(root, rng).text = text(rng)


def _insert(root: Element, rng: Random) -> None:
    element = Element(rng.choice(TAGS), {rng.choice(ATTRIBUTES): rng.choice((number, text))(rng)})
    _pick(root, rng).append(element)


def _grow(root: Element, rng: Random) -> None:
    """A longer chain: more links and joints at the end of one joint's child."""
    joints, links = root.findall("joint"), root.findall("link")
    ends = [joint.find("child") for joint in joints]
    names = [end.get("link", "") for end in ends if end is not None]
    if not names or not links:
        return
    parent = rng.choice(names)
    for k in range(rng.choice((1, 1, 2, 6, MOST_COPIES))):
        joint, link = copy.deepcopy(rng.choice(joints)), copy.deepcopy(rng.choice(links))
        link.set("name", f"grown{k}")
        joint.set("name", f"growing{k}")
        for tag, name in (("parent", parent), ("child", f"grown{k}")):
            end = joint.find(tag)
            if end is not None:
                end.set("link", name)
        root.extend((link, joint))
        parent = f"grown{k}"


_EDITS = (
    _number,
    _number,
    _number,
    _number,
    _attribute,
    _attribute,
    _type,
    _drop,
    _repeat,
    _move,
    _tag,
    _text,
    _insert,
    _grow,
)
