"""A Chain as plain JSON values and back, every number exactly.

JSON has no NaN and no infinity: an unknown parameter and an absent limit are null.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from psdmc.robot.chain import PARAMETERS_PER_LINK, Chain, Joint, Limits, Placement

_NO_LIMIT = {"lower": -math.inf, "upper": math.inf, "speed": math.inf, "acceleration": math.inf}
_NO_LIMIT["effort"] = math.inf


def chain_to_json(chain: Chain) -> dict[str, Any]:
    rows, columns = np.nonzero(chain.parameter_span)
    values = chain.parameter_span[rows, columns]
    return {
        "name": chain.name,
        "convention": chain.convention,
        "base_name": chain.base_name,
        "tip_name": chain.tip_name,
        "gravity": chain.gravity.tolist(),
        "tip": _placement_to_json(chain.tip),
        "joints": [_joint_to_json(joint) for joint in chain.joints],
        "parameters": [[None if math.isnan(v) else v for v in row] for row in chain.parameters.tolist()],
        "parameter_span": {
            "columns": chain.parameter_span.shape[1],
            "rows": rows.tolist(),
            "in_columns": columns.tolist(),
            "values": values.tolist(),
        },
        "notes": list(chain.notes),
    }


def chain_from_json(data: dict[str, Any]) -> Chain:
    """KeyError, TypeError or ValueError where the values are not a chain's."""
    joints = tuple(_joint_from_json(joint) for joint in data["joints"])
    span = np.zeros((PARAMETERS_PER_LINK * len(joints), data["parameter_span"]["columns"]))
    entries = data["parameter_span"]
    span[entries["rows"], entries["in_columns"]] = entries["values"]
    return Chain(
        name=data["name"],
        convention=data["convention"],
        base_name=data["base_name"],
        tip_name=data["tip_name"],
        joints=joints,
        parameters=np.array([[math.nan if v is None else v for v in row] for row in data["parameters"]]),
        parameter_span=span,
        gravity=np.array(data["gravity"]),
        tip=_placement_from_json(data["tip"]),
        notes=tuple(data["notes"]),
    )


def _placement_to_json(placement: Placement) -> dict[str, Any]:
    return {"rotation": placement.rotation.tolist(), "translation": placement.translation.tolist()}


def _placement_from_json(data: dict[str, Any]) -> Placement:
    return Placement(np.array(data["rotation"]), np.array(data["translation"]))


def _joint_to_json(joint: Joint) -> dict[str, Any]:
    limits = {name: getattr(joint.limits, name) for name in _NO_LIMIT}
    return {
        "name": joint.name,
        "link_name": joint.link_name,
        "kind": joint.kind,
        "placement": _placement_to_json(joint.placement),
        "link_frame": _placement_to_json(joint.link_frame),
        "limits": {name: value if math.isfinite(value) else None for name, value in limits.items()},
    }


def _joint_from_json(data: dict[str, Any]) -> Joint:
    limits = {
        name: absent if data["limits"][name] is None else float(data["limits"][name])
        for name, absent in _NO_LIMIT.items()
    }
    if data["kind"] not in ("revolute", "prismatic"):
        raise ValueError(f"joint kind {data['kind']!r}")
    return Joint(
        data["name"],
        data["link_name"],
        data["kind"],
        _placement_from_json(data["placement"]),
        _placement_from_json(data["link_frame"]),
        Limits(**limits),
    )
