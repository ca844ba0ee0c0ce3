"""Limits how many repeated elements an MJCF file has, together with the files that it includes and attaches.

MuJoCo's compile time grows with the square of the number of copies and cannot be interrupted. A model that attaches
itself crashes MuJoCo. So psdmc checks both before it calls MuJoCo.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, ParseError

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException

from psdmc.errors import InputError
from psdmc.files import read_file
from psdmc.robot.limits import MAX_BYTES, MAX_COPIES, shown

REPEATING = ("replicate", "composite", "flexcomp")
"""Elements whose `count` says how many copies there are; of the last two, along up to three axes."""

WORD = re.compile(rb"<\s*(replicate|composite|flexcomp|attach|model)\b")
MAX_DEPTH = 300
"""Elements within each other: more than the joints of a robot."""
MAX_MODELS = 20
"""Models that are attached within each other."""
MOST_DIGITS = 1e15
"""Beyond, a number of copies is only called large."""


class _Count(NamedTuple):
    """Elements that a part of a file stands for, and those of them that are copies."""

    elements: float
    copies: float


@dataclass(slots=True)
class _Document:
    """A model's own file: the file that is read, or one that <model> names for <attach>.

    root      None: not well-formed, and nothing in it that could be counted
    models    of its <model> elements, by name
    included  files that are in it; MuJoCo takes each once
    """

    path: Path
    root: Element | None
    models: dict[str, Path] = field(default_factory=dict)
    included: set[Path] = field(default_factory=set)


@dataclass(slots=True)
class _Reading:
    """source: what messages call the robot's file. counts: of documents that are read; None while one is being read."""

    source: str
    counts: dict[Path, _Count | None] = field(default_factory=dict)
    documents: dict[Path, _Document] = field(default_factory=dict)
    attached: set[tuple[Path, str | None]] = field(default_factory=set)


def refuse_many_copies(path: Path, source: str) -> None:
    """Raise InputError if a file has more than MAX_COPIES repeated elements or attaches itself. Included and attached
    files count.

    The function also rejects meshes and height fields that are too large, and files with repetition that are not
    well-formed XML. MuJoCo reports all other faults.
    """
    copies = _of_document(path, _Reading(source)).copies
    if not copies <= MAX_COPIES:
        many = f"{copies:.0f}" if copies < MOST_DIGITS else f"more than {MOST_DIGITS:.0f}"
        raise InputError(
            f"{source}: <replicate>, <composite>, <flexcomp> or <attach> ask for {many} elements, "
            f"expected {MAX_COPIES} at most",
            "give a smaller count",
        )


def _of_document(path: Path, reading: _Reading) -> _Count:
    """A model's file, each read once."""
    where = _resolved(path)
    if where in reading.counts:
        known = reading.counts[where]
        if known is None:
            raise InputError(
                f"{reading.source}: {shown(path.name)} attaches itself", "leave that <model> out"
            )
        return known
    if sum(count is None for count in reading.counts.values()) >= MAX_MODELS:
        raise InputError(
            f"{reading.source}: models attach models more than {MAX_MODELS} deep", "attach what they attach"
        )
    reading.counts[where] = None
    document = _Document(path, _root(path, reading.source))
    reading.documents[where] = document
    root = document.root
    found = _Count(1.0, 0.0) if root is None else _of_element(root, path.parent, document, reading)
    reading.counts[where] = found
    return found


def _root(path: Path, source: str) -> Element | None:
    """A file's root element; None where it is none and has nothing to count."""
    text = _text(path, source)
    try:
        root: Element = defusedxml.ElementTree.fromstring(text.lstrip())
    except (ParseError, DefusedXmlException, ValueError, LookupError) as error:
        if WORD.search(text) is None:
            return None
        raise InputError(
            f"{source}: not well-formed XML ({shown(str(error))}), so that what it repeats cannot be counted",
            "correct it, or write the copies out",
        ) from None
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
    if depth > MAX_DEPTH:
        raise InputError(
            f"{source}: elements within each other {depth} deep, expected {MAX_DEPTH} at most", "nest less"
        )
    return root


def _text(path: Path, source: str) -> bytes:
    """A file's bytes; none of what is no file, or cannot be read. InputError where it is longer than robot files are."""
    try:
        if not path.is_file():
            return b""
        return read_file(path, MAX_BYTES, "include less", name=f"{source}: it includes {shown(path.name)}")
    except (OSError, ValueError):
        return b""


def _of_element(element: Element, folder: Path, document: _Document, reading: _Reading) -> _Count:
    """folder: of the file that the element stands in."""
    refuse_large(element, reading.source)
    inside = [_of_element(child, folder, document, reading) for child in element]
    file = element.get("file")
    if element.tag == "include" and file:
        inside += [
            _included(where / file, document, reading)
            for where in dict.fromkeys((folder, document.path.parent))
        ]
    elif element.tag == "model" and file:
        # A model to attach, which MuJoCo reads where it is named; what is read again are copies.
        path = folder / file
        is_new = _resolved(path) not in reading.counts
        found = _of_document(path, reading)
        root = reading.documents[_resolved(path)].root
        own = root.get("model") if root is not None else None
        document.models[element.get("name") or own or ""] = path
        inside.append(found if is_new else _Count(found.elements, found.elements))
    elif element.tag == "attach":
        inside.append(_attached(element, document, reading))
    elements = sum(part.elements for part in inside)
    if element.tag in REPEATING:
        made = _times(element.get("count", "1")) * max(1.0, elements)
        return _Count(made, made)
    return _Count(1.0 + elements, sum(part.copies for part in inside))


def _included(path: Path, document: _Document, reading: _Reading) -> _Count:
    """A file that is included; MuJoCo looks for it beside the file that names it, and beside the model's own."""
    where = _resolved(path)
    if where in document.included:
        return _Count(0.0, 0.0)
    document.included.add(where)
    root = _root(path, reading.source)
    return _Count(1.0, 0.0) if root is None else _of_element(root, path.parent, document, reading)


def _attached(element: Element, document: _Document, reading: _Reading) -> _Count:
    """Return the element that <attach> inserts: the model, or one of its bodies; a copy if used again."""
    path, name = document.models.get(element.get("model", "")), element.get("body")
    if path is None:
        return _Count(1.0, 0.0)
    where = _resolved(path)
    whole = reading.counts[where] or _Count(1.0, 0.0)
    root = reading.documents[where].root
    bodies = [] if root is None or not name else [b for b in root.iter("body") if b.get("name") == name]
    elements = whole.elements
    if bodies and not any(child.tag in (*REPEATING, "include", "attach") for child in bodies[0].iter()):
        elements = float(sum(1 for _ in bodies[0].iter()))
    is_new = (where, name) not in reading.attached
    reading.attached.add((where, name))
    return _Count(elements, 0.0 if is_new else elements)


def _times(count: str) -> float:
    """The product of the numbers of a `count`; one where there are none, which MuJoCo refuses."""
    try:
        return math.prod(max(1.0, float(number)) for number in count.split())
    except ValueError:
        return 1.0


def _resolved(path: Path) -> Path:
    """Return one path for two paths to the same file."""
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):
        return path


# Sizes that a single line asks for: MuJoCo has no bounds of its own on the meshes, fields and arrays that it makes.
MAX_POINTS = 10_000
"""Of a mesh that MuJoCo makes: its hull takes a second or two."""
MAX_CORNERS = 1_000
"""Of a cone, whose base is one face: MuJoCo's time grows with a power of them."""
MAX_CELLS = 4_000_000
"""Of a height field or a texture: tens of megabytes."""
MAX_ROOM = 1_000_000
"""Of what <size> reserves for each object or for users."""

SQUARED = ("supersphere", "supertorus")
"""Meshes of as many points as the square of their first parameter."""
GRIDS = ("plate", "wedge")
"""Meshes of as many points as the product of their first two."""
CONE = "cone"
"""A mesh whose first parameter is the corners of its base."""
ROOM = ("nkey", "nuserdata", "nuser_body", "nuser_jnt", "nuser_geom", "nuser_site", "nuser_cam", "nuser_tendon",
        "nuser_actuator", "nuser_sensor")  # fmt: skip


def refuse_large(element: Element, source: str) -> None:
    """Raise InputError if an MJCF element asks for more points, cells or numbers than a robot needs."""
    if element.tag == "mesh" and element.get("builtin"):
        most = MAX_CORNERS if element.get("builtin") == CONE else MAX_POINTS
        _refuse(_points(element), most, "points", f"mesh {_name(element)}", source)
    elif element.tag == "hfield":
        _refuse(
            _product(element, "nrow", "ncol"), MAX_CELLS, "cells", f"height field {_name(element)}", source
        )
    elif element.tag == "texture":
        _refuse(_product(element, "width", "height"), MAX_CELLS, "cells", f"texture {_name(element)}", source)
    elif element.tag == "size":
        for word in ROOM:
            _refuse(_product(element, word), MAX_ROOM, "numbers", f"<size {word}>", source)


def _refuse(asked: float, most: int, of_what: str, where: str, source: str) -> None:
    if not asked <= most:
        raise InputError(
            f"{source}: {where} asks for {asked:.3g} {of_what}, expected {most} at most",
            "give smaller numbers",
        )


def _points(element: Element) -> float:
    numbers = [_number(word) for word in element.get("params", "").split()]
    kind = element.get("builtin")
    if kind in SQUARED:
        return math.prod(numbers[:1] * 2)
    return math.prod(numbers[:2]) if kind in GRIDS else max([1.0, *numbers[:1]])


def _product(element: Element, *attributes: str) -> float:
    return math.prod(_number(element.get(word, "1")) for word in attributes)


def _number(word: str) -> float:
    """At least one; one where it is no number, which MuJoCo refuses."""
    try:
        return max(1.0, float(word))
    except ValueError:
        return 1.0


def _name(element: Element) -> str:
    return shown(element.get("name", ""))
