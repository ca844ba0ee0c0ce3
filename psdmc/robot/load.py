"""Reads a robot file with its options: recognises its format, and converts it. This is the first step of the compiler."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from psdmc.errors import InputError
from psdmc.files import in_words, read_file
from psdmc.robot.closed_loops import loop_tables, merged_loops
from psdmc.robot.dh import dh_draft
from psdmc.robot.draft import Snap, settled
from psdmc.robot.limits import MAX_BYTES
from psdmc.robot.load_options import DEFAULT_SNAP, LoadOptions, checked_options
from psdmc.robot.mechanism import Mechanism
from psdmc.robot.urdf.missing_inertia import with_massless_warning
from psdmc.robot.urdf.urdf_draft import urdf_draft
from psdmc.robot.urdf.urdf_words import with_source_words
from psdmc.robot.xacro_file import checked_packages, expanded
from psdmc.robot.xml_text import root_tag

MACRO = "<xacro:"
"""What a file has that xacro must expand. What xacro made of one still declares its namespace, and is a URDF."""

COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)

SourceFormat = Literal["urdf", "dh"]

PACKED = b"PK\x03\x04"
"""First bytes of a model file, which is an archive."""

__all__ = ["DEFAULT_SNAP", "LoadOptions", "LoadedRobot", "SourceFormat", "load_robot", "load_robot_text"]


@dataclass(frozen=True, slots=True, eq=False)
class LoadedRobot:
    """A robot read from a file: the mechanism, the text from which psdmc read it, and the options.

    source_name   the file's name in messages
    snap_report   every rotation that was replaced by a near one with exact zeros, with the angle between both (rad)
    """

    mechanism: Mechanism
    source_text: str
    source_format: SourceFormat
    source_name: str
    snap_report: tuple[Snap, ...]
    options: LoadOptions

    @property
    def chain(self) -> Mechanism:
        """The mechanism: joints, bodies and gravity of the robot. psdmc 0.1 used the name `chain` for it."""
        return self.mechanism

    def unsnapped(self) -> LoadedRobot:
        """Return the robot with the rotations as the file states them. psdmc uses this robot to compute the effect of
        snapping, which replaces rotations by near ones with exact zeros."""
        keywords = self.options.as_json() | {"snap": 0.0}
        return load_robot_text(self.source_text, self.source_format, source_name=self.source_name, **keywords)


def load_robot(
    path: str | Path, *, packages: Mapping[str, str | PathLike[str]] | None = None, **options: Any
) -> LoadedRobot:
    """Return the robot in a URDF, MJCF, xacro or DH TOML file. The option `loops` can be the path of a TOML with closed
    loops.

    The suffixes .toml and .xacro and the root element determine the format. Options are those of LoadOptions;
    `packages` are folders of ROS packages, by name, that a xacro file uses. Raises InputError if the file or an option
    is wrong.
    """
    file, tables = Path(path), None
    if isinstance(options.get("loops"), str | PathLike):
        tables = Path(options["loops"])
        options["loops"] = loop_tables(tables, robot_text(tables))
    text = robot_text(file)
    text, source_format, found = as_source(file, text, checked_options(**options), checked_packages(packages))
    _refuse_size(len(text.encode(errors="replace")), file.name)
    return _loaded(text, source_format, file.name, found, tables.name if tables else None)


def load_robot_text(
    text: str, source_format: SourceFormat, *, source_name: str = "robot", **options: Any
) -> LoadedRobot:
    """Return the robot in a text, such as a saved model's source. Options and errors: see load_robot."""
    _refuse_size(len(text.encode(errors="replace")), source_name)
    return _loaded(text, source_format, source_name, checked_options(**options))


def _loaded(
    text: str, source_format: SourceFormat, source: str, options: LoadOptions, loops_file: str | None = None
) -> LoadedRobot:
    if not text.strip():
        raise InputError(f"{source}: the file is empty", "give a URDF or a DH .toml file")
    if source_format == "urdf":
        draft = with_source_words(urdf_draft(text, source, options), text, source)
    else:
        draft = dh_draft(text, source, options)
    mechanism = with_massless_warning(settled(draft, options, source, loops_file))
    return LoadedRobot(mechanism, text, source_format, source, draft.snaps, options)


def _refuse_size(size: int, source: str) -> None:
    if size > MAX_BYTES:
        raise InputError(
            f"{source}: more than {in_words(MAX_BYTES)}, which is the most that psdmc reads",
            "give a URDF or a DH .toml file",
        )


def robot_text(file: Path) -> str:
    """Return the text of a robot file. Raises InputError if it is unreadable, no text, or too large."""
    try:
        data = read_file(file, MAX_BYTES, "give a URDF or a DH .toml file")
        if data.startswith(PACKED):
            raise InputError(
                f"{file}: a packed file, as models are, and no robot's", "give a URDF or a DH .toml file"
            )
        return data.decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{file}: no such file", "give the path of a URDF or DH .toml file") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: not a UTF-8 text", "give a URDF or a DH .toml file") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{file}: cannot be read: {reason}", "check its path and rights") from None


def as_source(
    file: Path, text: str, options: LoadOptions, packages: Mapping[str, Path]
) -> tuple[str, SourceFormat, LoadOptions]:
    """Return the text of the robot to read, the format of the text, and the options. An MJCF file adds gravity, a
    floating base and closed loops to the options.

    packages   folders of ROS packages that a xacro file uses, by name

    Raises InputError if psdmc does not read the file's format, or if the format needs a package that is not installed.
    The error is also raised if an option is for files of another format.
    """
    suffix = file.suffix.lower()
    tag = "" if suffix == ".toml" else root_tag(text)
    is_xacro = (
        tag != "mujoco" and suffix != ".toml" and (suffix == ".xacro" or MACRO in COMMENT.sub("", text))
    )
    if options.root is not None and tag != "mujoco":
        raise InputError(f"{file.name}: --root names a body of an MJCF", "--base LINK is for URDFs")
    if options.xacro_args and not is_xacro:
        raise InputError(
            f"{file.name}: no xacro file, and {next(iter(options.xacro_args))!r} is given as an argument of one",
            "leave it out",
        )
    if (tag == "mujoco" or is_xacro) and not file.is_file():
        raise InputError(
            "cannot read an MJCF or xacro file from a pipe: it is read again with all that it includes",
            "give the file's path; a pipe may carry plain URDF: psdmc derive <(xacro FILE)",
        )
    if suffix == ".toml":
        return text, "dh", options
    if tag == "sdf":
        raise InputError(
            f"{file.name}: an SDF, which psdmc does not read",
            "give the URDF, xacro or MJCF that it was made from, or convert it, with sdf2urdf of pysdf for instance",
        )
    if tag == "mujoco":
        return _from_mjcf(file, options)
    if is_xacro:
        return expanded(file, file.name, options.xacro_args, packages), "urdf", options
    return text, "urdf", options


def _from_mjcf(file: Path, options: LoadOptions) -> tuple[str, SourceFormat, LoadOptions]:
    from psdmc.robot.mjcf.read_mjcf import read_mjcf

    found = read_mjcf(file, file.name, options.root)
    if found.is_free and (options.base is not None or options.tip is not None):
        raise InputError(
            f"{file.name}: its root moves freely, and --base and --tip need a robot on a fixed base",
            "leave --base and --tip out; --lock holds joints",
        )
    gravity = found.gravity if options.gravity is None else options.gravity
    if not all(map(math.isfinite, gravity)):
        raise InputError(
            f"{file.name}: gravity {' '.join(map('{:g}'.format, gravity))} is not finite",
            "correct gravity in <option>, or give --gravity",
        )
    floating = options.floating or found.is_free
    loops = merged_loops(found.loops, options.loops)
    return found.text, "urdf", replace(options, gravity=gravity, floating=floating, loops=loops)
