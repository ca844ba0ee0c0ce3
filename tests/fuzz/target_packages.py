"""Emitted packages: a manifest that is given, files of psdmc's and of others around it, and an emission over them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from fixtures import digest
from mutate_package import OUTSIDE
from outcome import BrokenRule

from psdmc.backends.manifest import JOURNAL, MANIFEST, edited_files
from psdmc.backends.package_folder import write_package

EARLIER = {"Makefile": "old:\n", "src/b.c": "/* old b.c */\n", "src/stale.c": "/* stale */\n"}
NEW = {
    "Makefile": "new:\n",
    "src/b.c": "/* new b.c */\n",
    MANIFEST: '{"generator": "psdmc", "robot": "arm", "name": "arm", "model_hash": "new", "joints": []}\n',
}
VICTIM, FOREIGN = "/* outside, with a digest that a manifest lists */\n", "/* written by somebody else */\n"
OTHERS = {"outside/arm/victim.h": VICTIM, "package/src/foreign.c": FOREIGN}
"""No manifest may have these changed: the one is not in the folder, the other has a digest that none lists."""


def manifest_seed() -> str:
    """The manifest of an earlier emission; one digest is the victim's, for forgeries to use."""
    files = {path: digest(text) for path, text in EARLIER.items()} | {"src/gone.c": digest(VICTIM)}
    return json.dumps({"schema": 1, "generator": "psdmc", "name": "arm", "files": files}, indent=2) + "\n"


def package(data: bytes, folder: Path, deep: bool) -> None:
    """What others wrote, inside the folder and outside it, is there afterwards. Deep: as a killed emission's journal."""
    root = folder / "package"
    given = data.replace(OUTSIDE.encode(), str(folder / "outside").encode())
    _write(folder)
    (root / MANIFEST).write_bytes(manifest_seed().encode() if deep else given)
    if deep:
        (root / JOURNAL).write_bytes(given)
    try:
        edited_files(root)
        write_package(root, NEW)
    finally:
        for name, text in OTHERS.items():
            file = folder / name
            if not file.is_file() or file.read_text(encoding="utf-8") != text:
                said = f"{name} is no longer what it was"
                raise BrokenRule("TouchedOthers", f"psdmc/backends/package_folder.py:{name}", said)


def _write(folder: Path) -> None:
    for name in ("package", "outside"):
        shutil.rmtree(folder / name, ignore_errors=True)
    root = folder / "package"
    (root / "src").mkdir(parents=True)
    (folder / "outside" / "arm").mkdir(parents=True)
    for path, text in EARLIER.items():
        (root / path).write_text(text, encoding="utf-8")
    for name, text in OTHERS.items():
        (folder / name).write_text(text, encoding="utf-8")
    (root / "include").symlink_to("../outside")
    (root / "src" / "linked.c").symlink_to("../../outside/arm/victim.h")
    (root / "test").symlink_to("nowhere")
