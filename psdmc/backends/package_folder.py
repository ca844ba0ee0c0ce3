"""Writes a package to its own folder, and compares a package on disk with what psdmc writes now.

Only changed files are written, and no file that psdmc did not write is overwritten.

psdmc recognises its files by their SHA-256. The manifest.json of the folder lists these digests; so does the journal of
an interrupted `emit-c`. Every other file is foreign: another program wrote it, or somebody edited it.
"""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from psdmc.backends import BACK_ENDS
from psdmc.backends.c.adapters import ADAPTERS
from psdmc.backends.manifest import (
    GENERATOR,
    JOURNAL,
    MANIFEST,
    NOT_REGULAR,
    Digests,
    content_of,
    digest,
    digest_of,
    link_in,
    listed,
    renamed,
)
from psdmc.errors import InputError
from psdmc.files import (
    missing_folders,
    refuse_foreign_folder,
    remove_if_empty,
    remove_leftovers,
    system_errors_at,
    write_together,
)
from psdmc.robot.limits import shown
from psdmc.target.presets import NATIVE


class Changes(list[str]):
    """Paths of a package's files that changed, including removed files.

    removed  files of the earlier package that the new package does not have
    kept     foreign files that were in the way, and the new names under which they are kept
    renamed  C names in the earlier package, and their new names
    replaced if the earlier package was of another robot: descriptions of that robot and of the new one; else None
    """

    def __init__(
        self,
        written: Iterable[str],
        removed: Iterable[str],
        kept: Mapping[str, str],
        renamed: Iterable[tuple[str, str]],
        replaced: tuple[str, str] | None,
    ) -> None:
        self.removed, self.kept, self.renamed = tuple(removed), dict(kept), tuple(renamed)
        self.replaced = replaced
        super().__init__([*written, *self.removed])


def require_own_folder(directory: str | os.PathLike[str], force: bool = False) -> None:
    """Raise InputError if a folder holds files, but neither a package of psdmc nor the journal of an interrupted
    `emit-c`. With `force`, no folder raises an error."""
    root = Path(directory)
    with system_errors_at(root):
        own = force or bool(listed(root / MANIFEST) or listed(root / JOURNAL))
    if not own:
        refuse_foreign_folder(
            root, "choose a new or empty folder with -o, or write beside these files with --force"
        )


def write_package(
    directory: str | os.PathLike[str], files: Mapping[str, str], force: bool = False
) -> Changes:
    """Write `files` (path -> text) under `directory`, and return the paths that changed.

    Unchanged files are not touched. Files that the package had before and no longer has are removed. With `force`, a
    foreign file that is in the way is kept under another name.

    Raises InputError if the folder is another program's, or if a foreign file is in the way, unless `force` is set.
    Raises InputError also if a symbolic link or a folder is in the way, or if the folder cannot take files. Raises
    ToolchainError if the disk fails.

    Nothing is written before all files were checked, and all content is on disk before the first file is replaced. If
    writing is interrupted between two files, the next call finds the journal and completes or replaces the package.
    """
    root = Path(directory)
    require_own_folder(root, force)
    with system_errors_at(root):
        return _write(root, files, force)


def _write(root: Path, files: Mapping[str, str], force: bool) -> Changes:
    manifest, journal = listed(root / MANIFEST), listed(root / JOURNAL)
    before = content_of(root)
    present = {path: digest_of(root, path) for path in files}
    changed = {path: text for path, text in files.items() if present[path] != digest(text)}
    for path in changed:
        if link_in(root, path):
            raise InputError(
                f"{root}: not writing {path}: it is a symbolic link",
                "remove the link, or choose another folder",
            )
    foreign = [path for path in changed if not _is_own(path, present[path], manifest, journal)]
    blocked = [path for path in foreign if not force or present[path] == NOT_REGULAR]
    if blocked:
        raise InputError(
            f"{root}: not overwriting {', '.join(blocked[:3])}{' ...' if len(blocked) > 3 else ''}: "
            "not as psdmc wrote it",
            "choose another folder" + ("" if force else ", or overwrite with --force"),
        )
    kept = {path: _copied(root, path) for path in foreign if path not in manifest and path not in journal}
    stale = _stale(root, files, manifest, journal)
    if changed or stale:
        _replace(root, changed, stale, journal)
    for folder in dict.fromkeys((root / path).parent for path in files):
        remove_leftovers(folder)  # of a killed emission
    (root / JOURNAL).unlink(missing_ok=True)
    after = json.loads(files[MANIFEST]) if MANIFEST in files else {}
    symbols = renamed(before, after) if before and after else []
    return Changes(changed, stale, kept, symbols, _robots(before, after) if before and after else None)


def _robots(before: Mapping[str, Any], after: Mapping[str, Any]) -> tuple[str, str] | None:
    """The robots of two manifests if these differ: in their joints, or in name and model. The first may be forged."""
    joints = [
        [joint.get("name") for joint in found if isinstance(joint, dict)] if isinstance(found, list) else []
        for found in (before.get("joints"), after["joints"])
    ]
    differ = [before.get(key) != after[key] for key in ("name", "model_hash")]
    if joints[0] == joints[1] and not all(differ):
        return None
    was, now = (
        f"{shown(content.get('name'))} ({len(names)} joint{'' if len(names) == 1 else 's'})"
        for content, names in zip((before, after), joints, strict=True)
    )
    return was, now


def _copied(root: Path, path: str) -> str:
    """The free name under which a file of another's is kept."""
    names = (f"{path}.orig{number or ''}" for number in count())
    free = next(name for name in names if not os.path.lexists(root / name))
    shutil.copy2(root / path, root / free)
    return free


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
    missing = missing_folders(root)
    known = {path: sorted(digests) for path, digests in journal.items()}
    for path, text in files.items():
        known[path] = sorted({digest(text), *known.get(path, ())})
    write_together(root, {JOURNAL: json.dumps({"generator": GENERATOR, "files": known}, indent=1) + "\n"})
    try:
        write_together(root, files)
    except BaseException:
        if not any(digest_of(root, path) == digest(text) for path, text in files.items()):
            (root / JOURNAL).unlink(missing_ok=True)  # nothing was replaced
            for folder in reversed(missing):
                remove_if_empty(folder)
        raise
    for path in stale:
        (root / path).unlink(missing_ok=True)
        for folder in list(Path(path).parents)[:-1]:
            with suppress(OSError):  # it is not empty
                (root / folder).rmdir()  # make would take an empty folder for a target that is up to date


# A package on disk: its options, and in which files it differs


MORE_SOURCES = {name: f"src/{name}.c" for name in ("payload", "friction", "bodies")}
"""By option, the source file that it adds to a package."""


@dataclass(frozen=True, slots=True)
class Differences:
    """How a package on disk differs from what psdmc writes now.

    missing  paths of files that the folder lacks
    added    paths of files that psdmc no longer writes
    changed  paths of files whose bytes differ
    reasons  possible reasons, in sentences, from a comparison of the manifests
    """

    missing: tuple[str, ...]
    added: tuple[str, ...]
    changed: tuple[str, ...]
    reasons: tuple[str, ...]

    def __bool__(self) -> bool:
        return bool(self.missing or self.added or self.changed)


def recorded_options(directory: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the options of psdmc.compiler.emit with which a package was generated. They are read from the manifest of
    the package, which may be forged.

    Raises InputError if the folder holds no package, or if the manifest lacks an option.
    """
    with system_errors_at(directory):
        content = content_of(directory)
    if not content:
        raise InputError(
            f"{directory}: not a package: {MANIFEST} is missing or is not psdmc's",
            "name the folder of a package with -o; psdmc emit-c writes one",
        )
    files, functions, options = (content.get(key) for key in ("files", "functions", "options"))
    files, options = (each if isinstance(each, dict) else {} for each in (files, options))
    named = (
        [each.get("name") for each in functions if isinstance(each, dict)]
        if isinstance(functions, list)
        else []
    )
    texts = {
        "backend": content.get("backend", BACK_ENDS[0]),
        "name": content.get("name"),
        "lowering": options.get("lowering"),
        "real": options.get("real"),
        "target": options.get("target", NATIVE.name),
        **{key: options[key] for key in ("trig", "estimator") if key in options},
    }
    wrong = [key for key, value in texts.items() if not isinstance(value, str)]
    wrong += [] if texts["backend"] in BACK_ENDS else ["back end"]
    if wrong or not named or not all(isinstance(name, str) for name in named):
        raise InputError(
            f"{Path(directory) / MANIFEST}: does not say with which {(*wrong, 'functions')[0]} psdmc emitted the package",
            "emit the package again without --check",
        )
    more: dict[str, Any] = {option: path in files for option, path in MORE_SOURCES.items()}
    if options.get("friction") == "in-dynamics":
        more |= {"friction": "in-dynamics", "smoothing-speed": _number(options.get("smoothing-speed"))}
    if "gravity-input" in options:
        more["gravity-input"] = True
    adapters = tuple(name for name in ADAPTERS if any(path.startswith(f"{name}/") for path in files))
    return {**texts, "functions": tuple(named), **more, "with": adapters}


def _number(text: object) -> float:
    """A recorded number; NaN, which no option may be, where it is none."""
    try:
        return float(text) if isinstance(text, str) else math.nan
    except ValueError:
        return math.nan


def differences(directory: str | os.PathLike[str], files: Mapping[str, str]) -> Differences:
    """Return how the package in a folder differs from `files` (path -> text). Writes nothing."""
    root = Path(directory)
    with system_errors_at(root):
        before, after = content_of(root), json.loads(files[MANIFEST])
        present = {path: digest_of(root, path) for path in files}
        gone = [path for path in listed(root / MANIFEST) if path not in files]
        added = tuple(path for path in gone if digest_of(root, path) is not None)
    reasons = []
    if not (version := before.get("psdmc_version")):
        reasons.append(f"{MANIFEST} is damaged: it does not say which psdmc wrote the package")
    elif version != after["psdmc_version"]:
        reasons.append(f"psdmc {version} wrote the package, and this is {after['psdmc_version']}")
    if before.get("model_hash") != after["model_hash"]:
        reasons.append("the package was emitted from another model")
    return Differences(
        missing=tuple(path for path, found in present.items() if found is None),
        added=added,
        changed=tuple(path for path, text in files.items() if present[path] not in (None, digest(text))),
        reasons=tuple(reasons),
    )
