"""The file manifest.json, which describes a package and lists the SHA-256 of each file as psdmc wrote it."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from psdmc.backends.info import JointInfo, PackageInfo
from psdmc.model.parameter_table import BaseParameters

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
