"""Package files onto the disk: whole or not at all, and never over what psdmc did not write.

A file is psdmc's own if the folder's manifest.json lists it with the digest that it has. Everything else
that stands in the way is foreign: another program's, or psdmc's own but edited since.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from psdmc.emit.manifest import GENERATOR, digest
from psdmc.errors import InputError, ToolchainError

MANIFEST = "manifest.json"


def write_package(
    directory: str | os.PathLike[str], files: Mapping[str, str], force: bool = False
) -> list[str]:
    """Write `files` (path -> text) under `directory`; returns the paths that changed, removed ones included.

    Unchanged files are not touched; files of an earlier emission that are no longer part of it are removed.
    InputError where a foreign file stands in the way and `force` is not set; ToolchainError where the folder
    cannot be written. Nothing is written before all files were looked at, and each is replaced in one step.
    """
    root = Path(directory)
    try:
        return _write(root, files, force)
    except OSError as error:
        where = error.filename or root
        raise ToolchainError(
            f"{where}: cannot be written: {error.strerror}", "choose another folder with -o"
        ) from error


def _write(root: Path, files: Mapping[str, str], force: bool) -> list[str]:
    listed = _listed(root / MANIFEST)
    present = {path: _text(root / path) for path in files}
    changed = [path for path, text in files.items() if present[path] != text]
    foreign = [path for path in changed if not _is_own(path, present[path], listed)]
    if foreign and not force:
        raise InputError(
            f"{root}: not overwriting {', '.join(foreign[:3])}{' ...' if len(foreign) > 3 else ''}: "
            "not as psdmc wrote it",
            "choose another folder, or overwrite with --force",
        )
    stale = [path for path in listed if path not in files and _is_own(path, _text(root / path), listed)]
    stale = [path for path in stale if (root / path).is_file()]
    for path in changed:
        write_atomically(root / path, files[path])
    for path in stale:
        (root / path).unlink()
    return changed + stale


def _is_own(path: str, text: str | None, listed: Mapping[str, str]) -> bool:
    """Whether this path is free, or holds what psdmc put there."""
    if text is None:
        return True
    return bool(listed) if path == MANIFEST else listed.get(path) == digest(text)


def _text(path: Path) -> str | None:
    """A file's text; None where there is none. What is no UTF-8 reads as no text of ours."""
    try:
        return path.read_bytes().decode("utf-8", errors="replace")
    except FileNotFoundError:
        return None


def _listed(path: Path) -> dict[str, str]:
    """Path -> digest as an earlier manifest lists them; empty where there is none, or not one of psdmc's."""
    try:
        content = json.loads(_text(path) or "{}")
    except ValueError:
        return {}
    if not isinstance(content, dict) or content.get("generator") != GENERATOR:
        return {}
    files = content.get("files")
    if not isinstance(files, dict):
        return {}
    return {str(name): str(value) for name, value in files.items() if _is_inside(str(name))}


def _is_inside(name: str) -> bool:
    """Whether a manifest's path stays in its folder: manifests are files like any other and may be forged."""
    path = Path(name)
    return not path.is_absolute() and ".." not in path.parts


def write_atomically(path: Path, text: str) -> None:
    """Replace a file in one step: a reader sees the old text or the new."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _umask() -> int:
    """The process's file mode mask, which can only be read by setting it."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
