"""Recognises a robot file's format by name and first element, and converts it to a URDF or DH table."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

from psdmc.errors import InputError
from psdmc.robot.load_options import LoadOptions
from psdmc.robot.xml_text import root_tag

ROBOT_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".toml")
"""Endings of files that `psdmc show` reads as a robot; all others are models."""

MACRO = "<xacro:"
"""What a file has that xacro must expand. What xacro made of one still declares its namespace, and is a URDF."""

COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)

SourceFormat = Literal["urdf", "dh"]


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
        from psdmc.robot.xacro_file import expanded

        return expanded(file, file.name, options.xacro_args, packages), "urdf", options
    return text, "urdf", options


def _from_mjcf(file: Path, options: LoadOptions) -> tuple[str, SourceFormat, LoadOptions]:
    from psdmc.robot.closed_loops import merged_loops
    from psdmc.robot.mjcf import read_mjcf

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
