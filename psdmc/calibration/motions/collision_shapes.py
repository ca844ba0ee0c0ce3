"""A URDF's collision shapes for Pinocchio: the elements that matter, and meshes from folders that the user names.

A file's words never become a path unchecked: meshes are read below the given folders alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

from psdmc.errors import InputError
from psdmc.robot.limits import shown
from psdmc.robot.numerals import words
from psdmc.robot.pinocchio_text import dynamics_of
from psdmc.robot.xml_text import parse_xml

SHAPES: Mapping[str, tuple[str, ...]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("filename", "scale"),
}
"""Shapes that a URDF may have, with their attributes."""
PLACE: tuple[str, ...] = ("xyz", "rpy")
MESH_KINDS = (".stl", ".dae", ".obj", ".ply")
LARGEST_MESH = 64 * 2**20
"""bytes of a mesh's file."""
MOST_SHAPES = 1000


def with_shapes(text: str, source: str, folders: Sequence[Path]) -> tuple[str, int]:
    """The URDF that Pinocchio reads links, joints and collision shapes from, and the number of these shapes.

    folders   where packages and meshes lie: `package://NAME/PATH` is FOLDER/NAME/PATH, or FOLDER/PATH where FOLDER is
              called NAME; other names are FOLDER/NAME

    InputError where a shape cannot be used, or its mesh is not there.
    """
    root = parse_xml(text, source, "robot")
    found = dynamics_of(root, None, {"continuous": "revolute"})
    copies = {link.get("name", ""): link for link in found.findall("link")}
    count = 0
    for link in root.findall("link"):
        for shape in link.findall("collision"):
            count += 1
            if count > MOST_SHAPES:
                raise InputError(f"{source}: more than {MOST_SHAPES} collision shapes", "leave some out")
            where = f"{source}: collision shape of link {shown(link.get('name', ''))}"
            _copy(shape, copies[link.get("name", "")], where, folders)
    return tostring(found, encoding="unicode"), count


def _copy(shape: Element, link: Element, where: str, folders: Sequence[Path]) -> None:
    copy = SubElement(link, "collision")
    origin = shape.find("origin")
    if origin is not None:
        place = {name: " ".join(words(origin.attrib[name])) for name in PLACE if name in origin.attrib}
        SubElement(copy, "origin", place)
    kinds = [child for part in shape.findall("geometry") for child in part if child.tag in SHAPES]
    if len(kinds) != 1:
        raise InputError(
            f"{where}: found {len(kinds)} shapes, expected one of {', '.join(SHAPES)}", "correct the file"
        )
    kind = kinds[0]
    given = {name: kind.attrib[name] for name in SHAPES[kind.tag] if name in kind.attrib}
    values = {name: " ".join(words(value)) for name, value in given.items() if name != "filename"}
    if kind.tag == "mesh":
        values["filename"] = str(mesh_file(given.get("filename", ""), where, folders))
    SubElement(SubElement(copy, "geometry"), kind.tag, values)


def mesh_file(name: str, where: str, folders: Sequence[Path]) -> Path:
    """The file of a mesh below one of the folders; InputError where there is none, it is no mesh, or too large."""
    plain = name.removeprefix("file://")
    package, _, inside = plain.removeprefix("package://").partition("/")
    for folder in folders if "\0" not in name else ():
        root = folder.resolve()
        tries = [root / package / inside] if "package://" in name else [root / plain]
        if "package://" in name and root.name == package:
            tries.append(root / inside)
        for path in tries:
            path = path.resolve()
            if path.is_relative_to(root) and path.is_file():
                return _checked(path, where)
    raise InputError(
        f"{where}: mesh {shown(name)} is in none of the given folders",
        "give the folder that its package is in: --meshes DIR",
    )


def _checked(path: Path, where: str) -> Path:
    if path.suffix.lower() not in MESH_KINDS:
        raise InputError(
            f"{where}: {shown(path.name)} is no mesh ({', '.join(MESH_KINDS)})", "correct the file"
        )
    size = path.stat().st_size
    if size > LARGEST_MESH:
        raise InputError(
            f"{where}: {shown(path.name)} has {size} bytes, expected at most {LARGEST_MESH}",
            "use a coarser mesh",
        )
    return path
