"""Write a package to a folder: only files that changed, and no file over one that psdmc did not write.

A file is psdmc's own if the folder's manifest.json, or the journal of an emission that was killed, lists it with the
digest that it has. Every other file is foreign: another program's, or psdmc's own but edited since.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path

from psdmc.atomic import remove_leftovers, system_errors_at, write_together, write_whole
from psdmc.emit.manifest import GENERATOR, digest
from psdmc.emit.own_files import JOURNAL, MANIFEST, Digests, digest_of, link_in, listed
from psdmc.errors import InputError


def write_package(
    directory: str | os.PathLike[str], files: Mapping[str, str], force: bool = False
) -> list[str]:
    """Write `files` (path -> text) under `directory`; returns the paths that changed, removed ones included.

    Unchanged files are not touched; files of an earlier emission that are no longer part of it are removed. InputError
    where a foreign file is in the way and `force` is not set, where a symbolic link is, and where the folder cannot
    take files; ToolchainError where the disk fails. Nothing is written before all files were checked; all content is on
    disk before the first file is replaced; an emission that is killed between two files is recognized by its journal,
    and finished or replaced by the next one.
    """
    root = Path(directory)
    with system_errors_at(root):
        return _write(root, files, force)


def _write(root: Path, files: Mapping[str, str], force: bool) -> list[str]:
    manifest, journal = listed(root / MANIFEST), listed(root / JOURNAL)
    present = {path: digest_of(root, path) for path in files}
    changed = {path: text for path, text in files.items() if present[path] != digest(text)}
    _refuse_links(root, changed)
    foreign = [path for path in changed if not _is_own(path, present[path], manifest, journal)]
    if foreign and not force:
        raise InputError(
            f"{root}: not overwriting {', '.join(foreign[:3])}{' ...' if len(foreign) > 3 else ''}: "
            "not as psdmc wrote it",
            "choose another folder, or overwrite with --force",
        )
    stale = _stale(root, files, manifest, journal)
    if changed or stale:
        _replace(root, changed, stale, journal)
    _tidy(root, files)
    return [*changed, *stale]


def _refuse_links(root: Path, paths: Mapping[str, str]) -> None:
    for path in paths:
        if link_in(root, path):
            raise InputError(
                f"{root}: not writing {path}: a symbolic link stands there",
                "remove the link, or choose another folder",
            )


def _is_own(path: str, found: str | None, manifest: Digests, journal: Digests) -> bool:
    """Whether this path is free, or holds a file that psdmc wrote."""
    if found is None or (path == MANIFEST and manifest):
        return True
    return found in manifest.get(path, ()) or found in journal.get(path, ())


def _stale(root: Path, files: Mapping[str, str], manifest: Digests, journal: Digests) -> list[str]:
    """Files of earlier emissions that are still as psdmc wrote them and that this one does not have."""
    gone = [path for path in {**manifest, **journal} if path not in files]
    found = {path: digest_of(root, path) for path in gone}
    return [
        path for path in gone if found[path] is not None and _is_own(path, found[path], manifest, journal)
    ]


def _replace(root: Path, files: Mapping[str, str], stale: list[str], journal: Digests) -> None:
    """Replace the files; the journal is written first, so that a killed emission's files are recognized."""
    root.mkdir(parents=True, exist_ok=True)
    known = {path: sorted(digests) for path, digests in journal.items()}
    for path, text in files.items():
        known[path] = sorted({digest(text), *known.get(path, ())})
    write_whole(root / JOURNAL, json.dumps({"generator": GENERATOR, "files": known}, indent=1) + "\n")
    try:
        write_together(root, files)
    except BaseException:
        if not any(digest_of(root, path) == digest(text) for path, text in files.items()):
            (root / JOURNAL).unlink(missing_ok=True)  # nothing was replaced
        raise
    for path in stale:
        (root / path).unlink(missing_ok=True)


def _tidy(root: Path, files: Mapping[str, str]) -> None:
    """Remove what a killed emission left."""
    for folder in dict.fromkeys((root / path).parent for path in files):
        remove_leftovers(folder)
    (root / JOURNAL).unlink(missing_ok=True)
