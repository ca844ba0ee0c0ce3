"""MJCF files: what any XML is mutated by, and MuJoCo's own elements and attributes."""

from __future__ import annotations

from random import Random
from xml.etree.ElementTree import Element, ParseError, SubElement, fromstring, tostring

from mutate_xml import mutate_xml
from nasty import number, text

Choice = tuple[str, ...] | int

BOOL = ("true", "false", "auto")

ELEMENTS: dict[str, dict[str, Choice]] = {
    "joint": {
        "type": ("hinge", "slide", "ball", "free"), "axis": 3, "pos": 3, "ref": 1, "range": 2, "armature": 1,
        "stiffness": 3, "damping": 3, "limited": BOOL, "springref": 1, "frictionloss": 1, "actuatorfrcrange": 2,
    },
    "freejoint": {"name": ("root", "x")},
    "geom": {
        "type": ("sphere", "capsule", "box", "cylinder", "ellipsoid", "plane", "mesh", "hfield"), "size": 3,
        "density": 1, "mass": 1, "fromto": 6, "pos": 3, "quat": 4, "euler": 3, "mesh": ("none",),
    },
    "inertial": {"pos": 3, "mass": 1, "diaginertia": 3, "fullinertia": 6, "quat": 4},
    "body": {"pos": 3, "quat": 4, "euler": 3, "gravcomp": 1, "mocap": BOOL, "childclass": ("thin", "none")},
    "compiler": {
        "angle": ("degree", "radian"), "eulerseq": ("xyz", "ZYX", "zzz"), "autolimits": BOOL, "settotalmass": 1,
        "inertiafromgeom": BOOL, "boundmass": 1, "balanceinertia": BOOL, "inertiagrouprange": 2,
        "fusestatic": BOOL, "coordinate": ("local", "global"),
    },
    "option": {"gravity": 3, "density": 1, "viscosity": 1, "wind": 3, "timestep": 1},
    "include": {"file": ("robot.xml", "missing.xml", "/dev/zero", "..")},
    "motor": {"joint": ("turn", "hip_l", "left", "root"), "gear": 1, "armature": 1, "damping": 3},
    "flag": dict.fromkeys(("gravity", "equality", "constraint", "spring", "damper"), ("disable", "enable")),
    "model": {"name": ("m",), "file": ("robot.xml", "missing.xml")},
    "attach": {"model": ("m",), "body": ("a", "b", "x"), "prefix": ("p", "q")},
    "mesh": {"name": ("none",), "builtin": ("sphere", "supersphere", "supertorus", "cone", "plate"), "params": 3},
    "size": {"nkey": 1, "memory": ("1M", "x"), "nuserdata": 1},
    "asset": {}, "actuator": {},
    "equality": {}, "tendon": {}, "contact": {}, "keyframe": {}, "default": {"class": ("thin", "main", "x")},
    "frame": {"pos": 3, "quat": 4}, "site": {"pos": 3},
    "replicate": {"count": ("2", "9", "0", "-1", "1000000"), "offset": 3},
}  # fmt: skip
"""Elements with their attributes: words, or how many numbers."""


def mutate_mjcf(data: bytes, rng: Random) -> bytes:
    if rng.random() < 0.6:
        return mutate_xml(data, rng)
    try:
        root = fromstring(data)
    except (ParseError, ValueError, LookupError):
        return mutate_xml(data, rng)
    for _ in range(rng.choice((1, 1, 2, 4))):
        _edit(root, rng)
    return tostring(root, encoding="utf-8")


def _edit(root: Element, rng: Random) -> None:
    """An attribute of an element that is there, or an element more."""
    found = [element for element in root.iter() if ELEMENTS.get(element.tag)]
    if found and rng.random() < 0.7:
        element = rng.choice(found)
        name, choice = rng.choice(list(ELEMENTS[element.tag].items()))
        element.set(name, _value(choice, rng))
        return
    tag = rng.choice(list(ELEMENTS))
    chosen = {name: _value(choice, rng) for name, choice in ELEMENTS[tag].items() if rng.random() < 0.4}
    SubElement(rng.choice(list(root.iter())), tag, chosen)


def _value(choice: Choice, rng: Random) -> str:
    if isinstance(choice, tuple):
        return rng.choice((*choice, text(rng)))
    count = choice if rng.random() < 0.9 else rng.randrange(8)
    plain = rng.random() < 0.6
    return " ".join(f"{rng.uniform(-1.0, 1.0):.3g}" if plain else number(rng) for _ in range(count))
