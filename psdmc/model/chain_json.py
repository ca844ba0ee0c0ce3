"""Conversion of a Mechanism (the robot as read from its file) to plain JSON values and back. Every number stays exact.

JSON has no NaN and no infinity. Unknown parameters and missing joint limits therefore become null.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from psdmc.model.json_values import entries, number, numbers, part, record, text, whole
from psdmc.robot.coordinates import Coordinate, own_coordinates
from psdmc.robot.inertia import leading_rows
from psdmc.robot.joints import joint_type
from psdmc.robot.limits import LENGTH, MAX_LINKS, gravity_fault
from psdmc.robot.mechanism import (
    BASE,
    PARAMETERS_PER_LINK,
    POINT,
    ROW_NAMES,
    SURFACE,
    Array,
    Joint,
    Limits,
    Loop,
    Mechanism,
    NamedFrame,
    Placement,
)

MOST_JOINTS = 256
"""Largest number of joints in a model file: the span alone takes 0.5 kB times its square, 64 MB."""
MOST_FRAMES = 1000
MOST_NOTES = 100_000
ORTHONORMAL = 1e-6
"""Largest entry of R R^T - 1 that is accepted for a rotation. Rounding leaves 1e-15, and matrices of robot files are
made exact."""
FARTHEST = MAX_LINKS * LENGTH.most
"""m: with larger translations, numbers of the dynamics could exceed the range of 64-bit floats. No robot file that psdmc
reads gives them."""

_NO_LIMIT = {"lower": -math.inf, "upper": math.inf, "speed": math.inf, "acceleration": math.inf}
_NO_LIMIT["effort"] = math.inf


def chain_to_json(chain: Mechanism) -> dict[str, Any]:
    """Return the robot as plain JSON values. For a serial chain, these are equal to those of psdmc versions that had no
    trees."""
    rows, columns = np.nonzero(chain.parameter_span)
    found = {
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
            "values": chain.parameter_span[rows, columns].tolist(),
        },
        "notes": list(chain.notes),
    }
    if chain.massless:
        found["massless"] = list(chain.massless)
    # Files of versions without named frames have the tip alone.
    if [(frame.name, frame.rows) for frame in chain.frames] != [(chain.tip_name, POINT)]:
        found["frames"] = [_frame_to_json(frame) for frame in chain.frames]
    if chain.loops:
        found["loops"] = [_loop_to_json(loop) for loop in chain.loops]
    if not is_plain_chain(chain):
        found["parents"], found["tip_body"] = list(chain.parents), chain.tip_body
        found["coordinates"] = [
            [c.leader, c.ratio, c.offset, *(value for other in c.others for value in other)]
            for c in chain.coordinates
        ]
    return found


def is_plain_chain(chain: Mechanism) -> bool:
    """Return whether every version of psdmc can read this robot from a model file. It must be a serial chain of joints
    with one coordinate each, without mimic joints."""
    is_known = all(kind.about_z for kind in chain.types)
    return is_known and chain.is_serial and chain.coordinates == own_coordinates(len(chain))


def _tree_from_json(data: dict[str, Any], n: int) -> dict[str, Any]:
    """Keyword arguments of Mechanism: what each joint hangs on and follows, and where the tip is. Files of plain chains have
    none."""
    if "parents" not in data:
        return {}
    parents = entries(data["parents"], "parents", n)
    coordinates = entries(part(data, "coordinates", "the robot"), "coordinates", n)
    if not len(parents) == len(coordinates) == n:
        raise ValueError(f"{len(parents)} parents and {len(coordinates)} coordinates for {n} joints")
    return {
        "parents": tuple(whole(parent, "a parent", BASE, n - 1) for parent in parents),
        "tip_body": whole(part(data, "tip_body", "the robot"), "the tip's body", 0, n - 1),
        "coordinates": tuple(_coordinate_from_json(coordinate, n) for coordinate in coordinates),
    }


def _coordinate_from_json(data: object, n: int) -> Coordinate:
    values = entries(data, "a coordinate", 1 + 2 * n)
    if len(values) < 3 or len(values) % 2 == 0:
        raise ValueError(f"a coordinate has {len(values)} values, expected leader, ratio and offset")
    leader, ratio, offset, *others = values
    return Coordinate(
        None if leader is None else whole(leader, "a coordinate's leader", 0, n - 1),
        number(ratio, "a coordinate's ratio"),
        number(offset, "a coordinate's offset"),
        tuple(
            (whole(leader, "a coordinate's leader", 0, n - 1), number(ratio, "a coordinate's ratio"))
            for leader, ratio in zip(others[::2], others[1::2], strict=True)
        ),
    )


def _frame_to_json(frame: NamedFrame) -> dict[str, Any]:
    plain = {"name": frame.name, "joint": frame.joint, "placement": _placement_to_json(frame.placement)}
    return plain if frame.rows == POINT else {**plain, "rows": frame.rows}


def _loop_to_json(loop: Loop) -> dict[str, Any]:
    ends = {"first": _frame_to_json(loop.first), "second": _frame_to_json(loop.second)}
    passive = {"passive": list(loop.passive)} if loop.passive else {}
    return {"name": loop.name, **ends, "rows": list(loop.rows), **passive}


def _loop_from_json(data: object, joints: int) -> Loop:
    first, second = (_frame_from_json(part(data, end, "a loop"), joints, BASE) for end in ("first", "second"))
    rows = entries(part(data, "rows", "a loop"), "a loop's rows", len(ROW_NAMES))
    passive = entries(record(data, "a loop").get("passive", []), "passive joints", joints)
    return Loop(
        text(part(data, "name", "a loop"), "a loop's name"),
        first,
        second,
        tuple(whole(row, "a loop's row", 0, len(ROW_NAMES) - 1) for row in rows),
        tuple(whole(joint, "a passive joint", 0, joints - 1) for joint in passive),
    )


def _frame_from_json(data: object, joints: int, least: int = 0) -> NamedFrame:
    name = text(part(data, "name", "a frame"), "a frame's name")
    joint = whole(part(data, "joint", "a frame"), "a frame's joint", least, joints - 1)
    rows = whole(record(data, "a frame").get("rows", POINT), "a contact's rows", 0, SURFACE)
    return NamedFrame(name, joint, _placement_from_json(part(data, "placement", "a frame"), "a frame"), rows)


def chain_from_json(data: object) -> Mechanism:
    """Return the robot (a Mechanism) from plain JSON values. Raises ValueError with the name of the wrong value."""
    chain = record(data, "the chain")
    listed = entries(part(chain, "joints", "the chain"), "the chain's joints", MOST_JOINTS)
    if not listed:
        raise ValueError("the chain has no joints")
    n = len(listed)
    convention = text(part(chain, "convention", "the chain"), "the chain's convention")
    if convention not in ("urdf", "standard", "modified"):
        raise ValueError(f"the chain's convention is {convention!r}")
    return Mechanism(
        name=text(part(chain, "name", "the chain"), "the chain's name"),
        convention=convention,  # type: ignore[arg-type]
        base_name=text(part(chain, "base_name", "the chain"), "the chain's base"),
        tip_name=text(part(chain, "tip_name", "the chain"), "the chain's tip"),
        joints=tuple(_joint_from_json(joint) for joint in listed),
        parameters=_parameters(part(chain, "parameters", "the chain"), n),
        parameter_span=_span(part(chain, "parameter_span", "the chain"), n),
        gravity=_gravity_from_json(part(chain, "gravity", "the chain")),
        tip=_placement_from_json(part(chain, "tip", "the chain"), "the tip"),
        notes=tuple(
            text(note, "a note") for note in entries(part(chain, "notes", "the chain"), "notes", MOST_NOTES)
        ),
        # Files of earlier versions have no frames, massless links or loops.
        frames=tuple(
            _frame_from_json(frame, n)
            for frame in entries(chain.get("frames", []), "the chain's frames", MOST_FRAMES)
        ),
        massless=tuple(
            text(name, "a massless link's name")
            for name in entries(chain.get("massless", []), "massless links", n)
        ),
        loops=tuple(
            _loop_from_json(loop, n)
            for loop in entries(chain.get("loops", []), "the chain's loops", MOST_FRAMES)
        ),
        **_tree_from_json(chain, n),
    )


def _gravity_from_json(data: object) -> Array:
    gravity = numbers(data, "the chain's gravity", 3)
    fault = gravity_fault(gravity.tolist())
    if fault:
        raise ValueError(f"the chain's gravity {fault}")
    return gravity


def _parameters(rows: object, n: int) -> Array:
    """Numbers, NaN for null."""
    table = [
        entries(row, "a link's parameters", PARAMETERS_PER_LINK) for row in entries(rows, "parameters", n)
    ]
    return np.array([[math.nan if v is None else number(v, "a parameter") for v in row] for row in table])


def _span(data: object, n: int) -> Array:
    """The span's columns; each leads with a one in a row where all others are zero."""
    size = PARAMETERS_PER_LINK * n
    columns = whole(part(data, "columns", "the span"), "the span's columns", 0, size)
    rows, places, values = (
        entries(part(data, name, "the span"), f"the span's {name}", size * max(columns, 1))
        for name in ("rows", "in_columns", "values")
    )
    if not len(rows) == len(places) == len(values):
        raise ValueError("the span's rows, in_columns and values are not equally many")
    span = np.zeros((size, columns))
    for row, place, value in zip(rows, places, values, strict=True):
        where = (
            whole(row, "a row of the span", 0, size - 1),
            whole(place, "a column of the span", 0, columns - 1),
        )
        span[where] = number(value, "an entry of the span")
    leads = leading_rows(span)
    if columns and not np.array_equal(span[leads], np.eye(columns)):
        raise ValueError("the span is not in reduced column echelon form")
    return span


def _placement_to_json(placement: Placement) -> dict[str, Any]:
    return {"rotation": placement.rotation.tolist(), "translation": placement.translation.tolist()}


def _placement_from_json(data: object, what: str) -> Placement:
    rotation = numbers(part(data, "rotation", what), f"{what}'s rotation", 3, 3)
    is_small = np.abs(rotation).max() <= 1.0 + ORTHONORMAL  # no entry whose square overflows
    if not is_small or not np.allclose(rotation @ rotation.T, np.eye(3), rtol=0.0, atol=ORTHONORMAL):
        raise ValueError(f"{what}'s rotation is none")
    translation = numbers(part(data, "translation", what), f"{what}'s translation", 3)
    if np.abs(translation).max() > FARTHEST:
        raise ValueError(f"{what}'s translation is longer than {FARTHEST:g} m")
    return Placement(rotation, translation)


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


def _joint_from_json(data: object) -> Joint:
    limits = part(data, "limits", "a joint")
    found = {name: part(limits, name, "a joint's limits") for name in _NO_LIMIT}
    return Joint(
        text(part(data, "name", "a joint"), "a joint's name"),
        text(part(data, "link_name", "a joint"), "a link's name"),
        joint_type(text(part(data, "kind", "a joint"), "a joint's kind")),
        _placement_from_json(part(data, "placement", "a joint"), "a joint"),
        _placement_from_json(part(data, "link_frame", "a joint"), "a link frame"),
        Limits(**{k: _NO_LIMIT[k] if v is None else number(v, f"a joint's {k}") for k, v in found.items()}),
    )
