"""manifest.json: what the package is and what its files were when psdmc wrote them."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

from psdmc.emit.describe import option_items
from psdmc.emit.function_view import FunctionView
from psdmc.emit.info import JointInfo, PackageInfo
from psdmc.emit.options import EmitOptions
from psdmc.target.native import NATIVE
from psdmc.target.target import Target

SCHEMA = 1
GENERATOR = "psdmc"


def manifest(
    robot: str,
    info: PackageInfo,
    options: EmitOptions,
    functions: tuple[FunctionView, ...],
    files: Mapping[str, str],
) -> str:
    """JSON text; `files` are all others of the package, which it lists with their SHA-256."""
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
        "options": option_items(info, options),
        **_target(options.target),
        "real": options.c_real,
        "lanes": options.lanes,
        "joints": [_joint(joint) for joint in info.joints],
        "base_parameters": [
            {"equation": p.equation, "unit": p.unit, "value": p.value} for p in info.parameters
        ],
        "functions": [_function(function) for function in functions],
        "files": {path: digest(text) for path, text in files.items()},
    }
    return json.dumps(content, indent=2, ensure_ascii=True, allow_nan=False) + "\n"


def _target(target: Target) -> dict[str, Any]:
    """A target that was chosen: its name, and the flags that compilers take for it."""
    return {} if target == NATIVE else {"target": {"name": target.name, "flags": list(target.flags)}}


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


def _function(function: FunctionView) -> dict[str, Any]:
    return {
        "name": function.name,
        "meaning": function.meaning,
        "kernels": [
            {
                "name": kernel.name,
                "lowering": kernel.lowering,
                "cost": str(kernel.cost),
                **({"cost_with_limbs_in_lanes": str(kernel.limbs.cost)} if kernel.limbs else {}),
                "prototypes": [prototype.text for prototype in kernel.prototypes.values()],
            }
            for kernel in function.kernels
        ],
    }
