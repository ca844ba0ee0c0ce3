"""What a robot file is, by its name and its first element, and what the later stages read of it: a URDF or a DH table."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

from psdmc.errors import InputError
from psdmc.robot.load_options import LoadOptions

ROBOT_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".toml")
"""Endings of files that `psdmc show` reads as a robot; all others are models."""

MACRO = "<xacro:"
"""What a file has that xacro must expand. What xacro made of one still declares its namespace, and is a URDF."""

COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)

SourceFormat = Literal["urdf", "dh"]


def as_source(file: Path, text: str, options: LoadOptions) -> tuple[str, SourceFormat, LoadOptions]:
    """The text to read, its format, and the options with what the file itself says: an MJCF's gravity and free root.

    InputError where the file's format is not read, or needs a package that is not installed.
    """
    if file.suffix.lower() == ".toml":
        return text, "dh", options
    tag = _root_tag(text)
    if tag == "sdf":
        raise InputError(
            f"{file.name}: an SDF, which psdmc does not read",
            "give the URDF, xacro or MJCF that it was made from, or convert it, with sdf2urdf of pysdf for instance",
        )
    if tag == "mujoco":
        return _from_mjcf(file, options)
    if file.suffix.lower() == ".xacro" or MACRO in COMMENT.sub("", text):
        from psdmc.robot.xacro_file import expanded

        return expanded(file, file.name), "urdf", options
    return text, "urdf", options


def _root_tag(text: str) -> str:
    from psdmc.robot.mjcf import root_tag

    return root_tag(text)


def _from_mjcf(file: Path, options: LoadOptions) -> tuple[str, SourceFormat, LoadOptions]:
    from psdmc.robot.mjcf import read_mjcf

    found = read_mjcf(file, file.name)
    if found.is_free and (options.base is not None or options.tip is not None):
        raise InputError(
            f"{file.name}: its root moves freely, --base and --tip cut a chain out of a robot that stands",
            "leave --base and --tip out; --lock holds joints",
        )
    gravity = found.gravity if options.gravity is None else options.gravity
    return found.text, "urdf", replace(options, gravity=gravity, floating=options.floating or found.is_free)
