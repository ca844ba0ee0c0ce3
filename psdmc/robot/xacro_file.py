"""Expands a xacro file to a URDF by the program xacro, if it is installed."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from psdmc.errors import InputError
from psdmc.files import read_file
from psdmc.robot.limits import MAX_BYTES, listed, shown

REASON = 300
"""Characters of xacro's own message that an error repeats."""

UNDEFINED = "Undefined substitution argument"
"""What xacro's message has in it where an argument has neither value nor default."""

ASSIGNED = ":="
"""Stands between an argument's name and its value, as in ROS."""


def parsed_arguments(texts: Sequence[str]) -> dict[str, str]:
    """Return the values of a xacro file's arguments by name, from texts of the command line such as "name:=ur5e"."""
    found: dict[str, str] = {}
    for text in texts:
        name, assigned, value = text.partition(ASSIGNED)
        if not assigned or not name:
            raise InputError(
                f"xacro argument {shown(text)} is not of the form NAME:=VALUE",
                "give one robot's file, then its xacro arguments, such as name:=ur5e",
            )
        if name in found:
            raise InputError(f"xacro argument {shown(name)} is given twice", "give it once")
        found[name] = value
    return found


class _Arguments(dict[str, str]):
    """The arguments' values, which xacro adds defaults to; `asked` are those that the file declares or uses."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.asked: dict[str, None] = {}

    def __contains__(self, name: object) -> bool:
        self.asked[str(name)] = None
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked[name] = None
        return super().__getitem__(name)


def expanded(file: Path, source: str, given: Mapping[str, str], packages: Mapping[str, Path]) -> str:
    """Return the text of the URDF that xacro makes. xacro evaluates the expressions in the file and reads the files it
    includes.

    given      values of the file's arguments
    packages   folders of ROS packages that the file names, in addition to those that psdmc finds

    Raises InputError if xacro is not installed or rejects the file, if the file has no such argument, or if a package
    is not found.
    """
    try:
        import xacro
    except ImportError:
        raise InputError(
            f"{source}: a xacro file, and xacro is not installed",
            "pip install 'psdmc[xacro]', or expand it yourself: xacro FILE > robot.urdf",
        ) from None
    said, arguments, missing = io.StringIO(), _Arguments(given), list[str]()

    def find(name: str) -> str:
        folder = package_folder(name, packages, file)
        if folder is None:
            missing.append(name)
            raise LookupError(name)
        return str(folder)

    try:
        with contextlib.redirect_stderr(said), _reading_and_finding(xacro, find):
            text = str(xacro.process_file(str(file), mappings=arguments).toxml())
    except Exception as error:  # whatever an expression of the file raises
        if missing:
            raise InputError(
                f"{source}: package {shown(missing[0])} is not found",
                f"--package {missing[0]}=DIR, or set ROS_PACKAGE_PATH or AMENT_PREFIX_PATH",
            ) from None
        reason = " ".join((str(error) or said.getvalue()).split()) or type(error).__name__
        hint = (
            "give it behind the file: NAME:=VALUE"
            if UNDEFINED in reason
            else "see what it says by itself: xacro FILE"
        )
        raise InputError(f"{source}: xacro cannot expand it: {reason[:REASON]}", hint) from None
    strange = [name for name in given if name not in arguments.asked]
    if strange:
        raise InputError(
            f"{source}: it has no xacro argument {shown(strange[0])}",
            f"it has: {listed(arguments.asked) or 'none'}",
        )
    return text


@contextlib.contextmanager
def _reading_and_finding(xacro: Any, find: Any) -> Iterator[None]:
    """Let xacro open files by a limit on their size, and find packages by `find`: its own search needs an installed ROS."""
    from xacro import substitution_args

    before = substitution_args._eval_find
    xacro.open = _opened
    substitution_args._eval_find = substitution_args._eval_dict["find"] = find
    try:
        yield
    finally:
        del xacro.open
        substitution_args._eval_find = substitution_args._eval_dict["find"] = before


def _opened(name: str | os.PathLike[str]) -> io.StringIO:
    """A file that xacro reads, without blank lines before its first."""
    return io.StringIO(read_file(name, MAX_BYTES, "include less").decode("utf-8-sig").lstrip())


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
    """Return the folders of ROS packages by package name, after a check. Raises InputError if a package name is not
    valid, or if a folder does not exist."""
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
    """Return the absolute folder of a ROS package, or None.

    The folder comes from `given`, from AMENT_PREFIX_PATH (its share/NAME), from ROS_PACKAGE_PATH (the first
    package.xml with that name), or from the folders above or next to the robot's file, in this order.
    """
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
