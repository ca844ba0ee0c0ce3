"""Sizes that a line of an MJCF asks for: meshes and fields that MuJoCo makes, and arrays. It has no bounds of its own."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from psdmc.errors import InputError
from psdmc.robot.limits import shown

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
    """InputError where an element asks for more points, cells or numbers than a robot's file has use for."""
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
