"""Folders of ROS packages by name, without ROS: given ones, those of ROS variables, and those near the robot's file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from psdmc.errors import InputError
from psdmc.reading import read_file
from psdmc.robot.limits import shown

MANIFEST = "package.xml"
LARGEST_MANIFEST = 1 << 20
"""Bytes; a package has a few thousand."""
MOST_FOLDERS = 20_000
"""Folders below one of ROS_PACKAGE_PATH that are looked at: a workspace has a few thousand."""
IGNORED = ("CATKIN_IGNORE", "AMENT_IGNORE", "COLCON_IGNORE")
"""Files that keep a folder and all below it out of the search."""

NAME = re.compile(r"[A-Za-z0-9][\w.-]*", re.ASCII)
NAMED = re.compile(rb"<name>\s*([\w.-]+)\s*</name>")


def checked_packages(packages: Mapping[str, str | os.PathLike[str]] | None) -> dict[str, Path]:
    """Folders by package; InputError where a name is none, or a folder does not exist."""
    found = {}
    for name, folder in (packages or {}).items():
        path = Path(folder).expanduser()
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise InputError(f"{shown(name)} is no package's name", "such as --package ur_description=DIR")
        if not path.is_dir():
            raise InputError(f"package {shown(name)}: {path} is no folder", "give the package's folder")
        found[name] = path
    return found


def package_folder(name: str, given: Mapping[str, Path], file: Path) -> Path | None:
    """Return the absolute folder of a package, or None. It is the given one, else that of AMENT_PREFIX_PATH (its
    share/NAME) or of ROS_PACKAGE_PATH (the first package.xml with that name), else one above or next to the robot's
    file."""
    if not NAME.fullmatch(name):
        return None
    found = given.get(name) or next((folder for folder in _candidates(name, file)), None)
    return None if found is None else found.absolute()


def _candidates(name: str, file: Path) -> Iterator[Path]:
    for prefix in _folders("AMENT_PREFIX_PATH"):
        share = prefix / "share"
        indexed = share / "ament_index" / "resource_index" / "packages" / name
        if (share / name).is_dir() and (indexed.exists() or (share / name / MANIFEST).is_file()):
            yield share / name
    for root in _folders("ROS_PACKAGE_PATH"):
        yield from _below(root, name)
    for folder in file.absolute().parents:
        if folder.name == name or _is_package(folder, name):
            yield folder
        elif _is_package(folder / name, name):
            yield folder / name


def _folders(variable: str) -> list[Path]:
    return [Path(part) for part in os.environ.get(variable, "").split(os.pathsep) if part]


def _below(root: Path, name: str) -> Iterator[Path]:
    """Packages of that name, folders in order; nothing is looked for inside a package."""
    for count, (path, folders, files) in enumerate(os.walk(root, followlinks=True)):
        if count == MOST_FOLDERS:
            return
        if MANIFEST in files and _is_package(Path(path), name):
            yield Path(path)
        ends_here = MANIFEST in files or any(word in files for word in IGNORED)
        folders[:] = [] if ends_here else sorted(one for one in folders if not one.startswith("."))


def _is_package(folder: Path, name: str) -> bool:
    """Whether the folder's manifest has that name."""
    try:
        if not (folder / MANIFEST).is_file():
            return False
        found = NAMED.search(read_file(folder / MANIFEST, LARGEST_MANIFEST, "give another --package"))
    except OSError:
        return False
    return found is not None and found[1].decode() == name
