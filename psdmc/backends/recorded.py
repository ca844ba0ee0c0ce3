"""The options with which a package on disk was generated, and in which files it differs from what psdmc writes now."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psdmc.atomic import system_errors_at
from psdmc.backends.c.adapters import ADAPTERS
from psdmc.backends.manifest import MANIFEST, content_of, digest, digest_of, listed
from psdmc.backends.protocol import BACK_ENDS
from psdmc.errors import InputError
from psdmc.target.native import NATIVE

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
