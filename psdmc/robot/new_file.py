"""Writes a first robot file for the user to edit: a commented DH table that `derive` accepts."""

from __future__ import annotations

import json
import os
from importlib import resources
from pathlib import Path

from psdmc.errors import InputError
from psdmc.files import write_whole

TEMPLATE = "template.toml"


def write_new_robot(path: Path) -> None:
    """Write a commented DH table. The robot gets the name of the file.

    Raises InputError if `path` exists already, or if its suffix is not that of a DH table.
    """
    if path.suffix.lower() != ".toml":
        raise InputError(f"{path}: a DH table's name ends with .toml", f"such as psdmc new {path.stem}.toml")
    if os.path.lexists(path):
        raise InputError(f"{path}: exists already, and is left as it is", "give another name")
    text = resources.files("psdmc.robot").joinpath(TEMPLATE).read_text(encoding="utf-8")
    safe = path.name if path.name.isprintable() and path.name.isascii() else "ROBOT.toml"
    write_whole(path, text.replace("@FILE@", safe).replace("@NAME@", json.dumps(path.stem)))
