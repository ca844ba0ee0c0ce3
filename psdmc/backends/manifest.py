"""The file manifest.json, which describes a package and lists the SHA-256 of each file as psdmc wrote it. It shows
which files of a folder psdmc wrote."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from psdmc.backends.info import JointInfo, PackageInfo
from psdmc.errors import InputError
from psdmc.files import read_file
from psdmc.model.equations import BaseParameters

SCHEMA = 1
GENERATOR = "psdmc"

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")
"""Of robots in every language."""

RENAMED: Mapping[str, str] = {}
"""Functions that packages of an earlier release have by another name, and their name now. From 0.1 to this one, none."""


def manifest(
    robot: str,
    info: PackageInfo,
    options: Mapping[str, str],
    own: Mapping[str, Any],
    functions: Sequence[Mapping[str, Any]],
    files: Mapping[str, str],
) -> str:
    """Return the JSON text of manifest.json, which describes the package. `own` are entries for the language of the
    package, such as C. `files` are all other files of the package, which the manifest lists with their SHA-256."""
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "generator": GENERATOR,
        "psdmc_version": info.psdmc_version,
        "model_hash": info.model_hash,
        "robot": robot,
        "name": info.name,
        "base": info.base,
        "tip": info.tip,
        "gravity_m_s2": list(info.gravity),
        "options": dict(options),
        **own,
        "joints": [_joint(joint) for joint in info.joints],
        "base_parameters": BaseParameters(info.parameters).plain(),
        "functions": list(functions),
        "files": {path: digest(text) for path, text in files.items()},
    }
    return json.dumps(content, indent=2, ensure_ascii=True, allow_nan=False) + "\n"


def renamed(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the C names that changed from an older package to the new one, as pairs (old name, new name).

    If the robot's name changed, one pair such as (`old_*`, `new_*`) represents all C names. Further pairs are functions
    that psdmc itself renamed. The older manifest may be forged.
    """
    old, new = before.get("robot"), after["robot"]
    if not isinstance(old, str) or not NAME.fullmatch(old):
        return []
    pairs = [(f"{old}_*", f"{new}_*")] if old != new else []
    kernels, there = _kernel_names(before), _kernel_names(after)
    names = {f"{was}{form}": f"{now}{form}" for was, now in RENAMED.items() for form in ("", "_theta")}
    own = ((was, now) for was, now in names.items() if was in kernels and now in there)
    return [*pairs, *((f"{old}_{was}", f"{new}_{now}") for was, now in own)]


def _kernel_names(content: Mapping[str, Any]) -> list[object]:
    functions = content.get("functions")
    found = [each.get("kernels") for each in _objects(functions)]
    return [kernel.get("name") for kernels in found for kernel in _objects(kernels)]


def _objects(values: object) -> list[dict[str, object]]:
    return [each for each in values if isinstance(each, dict)] if isinstance(values, list) else []


def digest(text: str) -> str:
    """SHA-256 of a text as UTF-8, in hexadecimal digits."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def _joint(joint: JointInfo) -> dict[str, Any]:
    limits = {
        "lower": joint.lower,
        "upper": joint.upper,
        "speed": joint.speed,
        "acceleration": joint.acceleration,
        "effort": joint.effort,
    }
    known = {key: value for key, value in limits.items() if math.isfinite(value)}
    wide = {"nq": joint.nq, "nv": joint.nv, "coordinates": joint.coordinates} if joint.nq > 1 else {}
    return {
        "name": joint.name,
        "kind": joint.kind,
        "unit": joint.unit,
        "effort_unit": joint.effort_unit,
        "limits": known,
        **({"parent": joint.parent} if joint.parent else {}),
        **wide,
    }


# Which files of a folder psdmc wrote
#
# The manifest of the package says it. If `emit-c` was interrupted, so does the journal, a list of the files
# that were to be written.
#
# Both lists are ordinary files and may be forged. Names that psdmc would not give, and everything behind a
# symbolic link, count as foreign.


MANIFEST = "manifest.json"
JOURNAL = ".psdmc-emission.json"
"""Lists what an emission is about to write. It exists while it writes, and after it was killed."""

LARGEST_LIST = 16 << 20
"""Bytes of a manifest or journal that are read; a nine-joint arm's manifest has 0.1 MB."""

OWN_NAME = re.compile(
    r"""(?: (?: include/[A-Za-z_]\w* | src | test | casadi(?:_(?:theta|hessian))? | wheel | fmu2? | mex | ros2 )
              / [A-Za-z_]\w* \. (?: c | cpp | h | hpp | inc | cu | cuh )
          | cmake / [A-Za-z_]\w* \.cmake\.in
          | [A-Za-z_]\w* \.pc\.in
          | (?: src | tests ) / [a-z_]\w* \.rs
          | wheel / (?: __init__\.py | py\.typed )
          | ros2 / (?: plugins\.xml | package\.xml | CMakeLists\.txt )
          | mex / [A-Za-z_]\w* \. m
          | fmu2? / (?: modelDescription\.xml | buildDescription\.xml | pack\.py )
          | pyproject\.toml | setup\.py
          | Cargo\.toml | CMakeLists\.txt | Makefile | README\.md | LICENSE | package\.xml )""",
    re.VERBOSE | re.ASCII,
)
"""Every name that a package can have beside its manifest's own."""

NOT_REGULAR = "no regular file of this folder"
"""Takes the place of the digest of a folder, a device or anything behind a symbolic link."""

Digests = Mapping[str, frozenset[str]]


def listed(path: Path) -> Digests:
    """Return, by path, the SHA-256 digests of the files that a manifest or journal lists. Return an empty mapping if
    there is no such list, or if psdmc did not write it."""
    return {
        name: frozenset([value] if isinstance(value, str) else map(str, value))
        for name, value in _entries(path).items()
        if isinstance(value, str | list) and (OWN_NAME.fullmatch(name) or name == MANIFEST)
    }


def digest_of(root: Path, path: str) -> str | None:
    """Return the SHA-256 of a file below root; None if there is no such file."""
    try:
        if link_in(root, path) or not stat.S_ISREG((root / path).lstat().st_mode):
            return NOT_REGULAR
        with open(root / path, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except (FileNotFoundError, NotADirectoryError):
        return None


def link_in(root: Path, path: str) -> bool:
    """Whether a component of `path` below `root` is a symbolic link."""
    parts = Path(path).parts
    return any(root.joinpath(*parts[: k + 1]).is_symlink() for k in range(len(parts)))


def edited_files(directory: str | os.PathLike[str]) -> list[str] | None:
    """Return the paths of files in a package that are missing or differ from what psdmc wrote. Return None if the
    folder holds no package.

    The manifest.json of the package lists the digests of all files except itself. Raises InputError if a file cannot be
    read.
    """
    root = Path(directory)
    try:
        entries = _entries(root / MANIFEST)
        edited = [
            name
            for name, value in entries.items()
            if not OWN_NAME.fullmatch(name) or digest_of(root, name) != value
        ]
    except OSError as error:
        raise InputError(
            f"{error.filename or root}: cannot be read: {error.strerror}", "check its rights"
        ) from error
    return edited if entries else None


def content_of(directory: str | os.PathLike[str]) -> dict[str, object]:
    """Return the content of a package's manifest; empty if the folder holds no package."""
    return _content(Path(directory) / MANIFEST)


def target_of(directory: str | os.PathLike[str]) -> str | None:
    """Return the name of the target machine in a package's manifest; None if the manifest names none."""
    target = content_of(directory).get("target")
    name = target.get("name") if isinstance(target, dict) else None
    return name if isinstance(name, str) else None


def _entries(path: Path) -> dict[str, object]:
    files = _content(path).get("files")
    return files if isinstance(files, dict) else {}


def _content(path: Path) -> dict[str, object]:
    """Return the content of a manifest or journal of psdmc's; empty if there is none."""
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_LIST:
            return {}
        content = json.loads(read_file(path, LARGEST_LIST, "emit the package again"))
    except (FileNotFoundError, NotADirectoryError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) and content.get("generator") == GENERATOR else {}
