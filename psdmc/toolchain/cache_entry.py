"""One entry of the compile cache: a folder with the digests of its files, used only while they agree."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import stat
from pathlib import Path
from typing import Any

from psdmc.toolchain.cache_place import is_private

SEAL = "entry.json"
"""Lists an entry's files with their SHA-256; its time is that of the entry's last use."""

_PLAIN = re.compile(r"[\w-][\w.-]*")
"""A file's name without a folder: most are."""

LARGEST_SEAL = 1 << 20
"""Bytes; a six-joint arm's has 6 kB."""


def seal(folder: Path) -> None:
    """List every file with its digest, and make all of them writable by nobody but this user."""
    files: dict[str, str] = {}
    size = 0
    for path in sorted(folder.rglob("*")):
        if path.is_symlink():
            continue
        path.chmod(path.stat().st_mode & ~0o022)
        if path.is_file():
            files[str(path.relative_to(folder))] = _digest(path)
            size += path.stat().st_size
    text = json.dumps({"files": files, "bytes": size}, indent=1) + "\n"
    (folder / SEAL).write_text(text, encoding="utf-8")
    (folder / SEAL).chmod(0o600)


def is_sound(folder: Path) -> bool:
    """Whether an entry is complete, unaltered and writable by this user alone, and so safe to open."""
    try:
        if not _is_own(folder, stat.S_ISDIR):
            return False
        files = _sealed(folder)["files"]
        return bool(files) and all(
            _is_own(folder / name, stat.S_ISREG) and _digest(folder / name) == value
            for name, value in files.items()
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False


def touch(folder: Path) -> None:
    """Note that an entry was used now; ignored where the cache cannot be written."""
    with contextlib.suppress(OSError):
        os.utime(folder / SEAL)


def used_and_size(folder: Path) -> tuple[float, int]:
    """When an entry was last used (s since 1970) and its bytes; for one without seal, when it was made."""
    try:
        content, used = _seal_of(folder)
        return used, int(content["bytes"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        sizes = (Path(top, name).lstat().st_size for top, _, names in os.walk(folder) for name in names)
        return folder.lstat().st_mtime, sum(sizes)


def _is_own(path: Path, kind: object) -> bool:
    """Whether the path is a file or folder of that kind, no link, that no other user may write."""
    status = path.lstat()
    return bool(kind(status.st_mode)) and is_private(status)  # type: ignore[operator]


def _sealed(folder: Path) -> dict[str, Any]:
    return _seal_of(folder)[0]


def _seal_of(folder: Path) -> tuple[dict[str, Any], float]:
    """A seal's content, and when the entry was last used. A cache has thousands, all read at each build: paths are texts."""
    path = os.path.join(folder, SEAL)
    status = os.lstat(path)
    if not stat.S_ISREG(status.st_mode) or not is_private(status) or status.st_size > LARGEST_SEAL:
        raise ValueError(f"{path} is no seal")
    with open(path, "rb", buffering=0) as stream:
        content = json.loads(stream.read())
    if any(map(_is_elsewhere, content["files"])):
        raise ValueError(f"{path} names files elsewhere")
    return dict(content), status.st_mtime


def _is_elsewhere(name: str) -> bool:
    """Whether a name leads out of the folder."""
    if _PLAIN.fullmatch(name):
        return False
    path = Path(name)
    return path.is_absolute() or ".." in path.parts


def _digest(path: Path) -> str:
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
