"""Finds out which files of a folder psdmc wrote, from the manifest of the package. If `emit-c` was interrupted, it also
reads the journal, a list of the files that were to be written.

Both lists are ordinary files and may be forged. Names that psdmc would not give, and everything behind a symbolic link,
count as foreign.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path

from psdmc.backends.manifest import GENERATOR
from psdmc.errors import InputError
from psdmc.reading import read_file

MANIFEST = "manifest.json"
JOURNAL = ".psdmc-emission.json"
"""Lists what an emission is about to write. It exists while it writes, and after it was killed."""

LARGEST_LIST = 16 << 20
"""Bytes of a manifest or journal that are read; a nine-joint arm's manifest has 0.1 MB."""

OWN_NAME = re.compile(
    r"""(?: (?: include/[A-Za-z_]\w* | src | test | casadi(?:_(?:theta|hessian))? | wheel | fmu2? | mex | ros2 )
              / [A-Za-z_]\w* \. (?: c | cpp | h | hpp | inc )
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
    """What a manifest or journal of psdmc's says; empty where there is none."""
    try:
        status = path.lstat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_LIST:
            return {}
        content = json.loads(read_file(path, LARGEST_LIST, "emit the package again"))
    except (FileNotFoundError, NotADirectoryError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) and content.get("generator") == GENERATOR else {}
