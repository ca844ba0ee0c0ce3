"""Output of `psdmc show --json`: one JSON document, all numbers with all digits, null for unknown values."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Sequence
from typing import Any

from psdmc.cli.show import cost_rows, followed, joint_errors, position_range
from psdmc.cli.tables import Table, print_line, print_note, print_table
from psdmc.errors import InputError
from psdmc.lower.kernels import Lowering
from psdmc.model.calibrated_json import document
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.summary import summary, term_texts
from psdmc.robot.coordinates import leaders
from psdmc.robot.derivable import require_derivable
from psdmc.robot.mechanism import Joint, Mechanism

SCHEMA = 1
"""Of the documents: it grows where a key goes or means something else; further keys may come."""


def print_json(kind: str, content: dict[str, Any]) -> None:
    """Print one JSON document to standard output, in ASCII: its `kind`, which says what it describes, and the
    content."""
    document = {"schema": SCHEMA, "kind": kind, **content}
    print(json.dumps(document, indent=2, ensure_ascii=True, allow_nan=False))


def model_json(model: DynamicsModel) -> dict[str, Any]:
    """Return what `psdmc show --json` prints for a model."""
    found, robot = summary(model), model.mechanism
    errors = joint_errors(robot, found.certificate)
    joints = [{**joint, "error": error} for joint, error in zip(_joints(robot), errors, strict=True)]
    values = model.provenance.get("snap_torque_change")
    return {
        "name": found.name,
        "base": found.base,
        "tip": found.tip,
        "convention": found.convention,
        "gravity_m_s2": list(found.gravity),
        "joints": joints,
        "frames": [frame.name for frame in robot.frames],
        "contacts": model.contacts,
        "p": found.p,
        "l": found.l,
        "monomials": None if found.sizes is None else found.sizes._asdict(),
        "entries_of_P": found.entries,
        "base_parameters": model.base_parameters.plain(),
        "largest_torque_error": max(found.certificate),
        "snap_torque_change": None if values is None else [_finite(float(value)) for value in values],
        "notes": list(found.notes),
        "calibration": None if model.calibrated is None else document(model.calibrated),
        "source": {"name": found.source_name, "sha256": found.source_sha256},
        "options": _plain(model.provenance.get("options")),
        "model_hash": found.content_hash,
    }


def mechanism_json(robot: Mechanism) -> dict[str, Any]:
    """Return what `psdmc show --json` prints for a robot file."""
    refused = why_not_derived(robot)
    joints = [
        {**joint, "mass_kg": _finite(float(row[0]))}
        for joint, row in zip(_joints(robot), robot.parameters, strict=True)
    ]
    return {
        "name": robot.name,
        "base": robot.base_name,
        "tip": robot.tip_name,
        "ends": [robot.joints[leaf].link_name for leaf in robot.leaves],
        "gravity_m_s2": robot.gravity.tolist(),
        "joints": joints,
        "notes": list(robot.notes),
        "not_derived_because": None if refused is None else refused.message,
    }


def terms_json(model: DynamicsModel) -> dict[str, Any]:
    """Return the products of joint variables (monomials y) in a model's torques, as texts, in the order of matrix E's
    columns."""
    return {"terms": list(term_texts(model))}


def cost_json(model: DynamicsModel, lowerings: Sequence[Lowering]) -> dict[str, Any]:
    """Operations of each function per lowering."""
    rows, notes = cost_rows(model, lowerings)
    return {"functions": rows, "notes": list(notes)}


def _joints(robot: Mechanism) -> list[dict[str, Any]]:
    return [_joint(robot, i, joint) for i, joint in enumerate(robot.joints)]


def _joint(robot: Mechanism, i: int, joint: Joint) -> dict[str, Any]:
    coordinate, limits = robot.coordinates[i], joint.limits
    leader = None if coordinate.leader in (None, i) else robot.joints[coordinate.leader].name
    follows = (
        None
        if coordinate.leader == i
        else {"joint": leader, "ratio": coordinate.ratio, "offset": coordinate.offset}
        | (
            {"others": [{"joint": robot.joints[k].name, "ratio": ratio} for k, ratio in coordinate.others]}
            if coordinate.others
            else {}
        )
    )
    return {
        "name": joint.name,
        "link": joint.link_name,
        "parent_link": robot.parent_link(i),
        "type": joint.type.word,
        "position_unit": joint.type.position_unit,
        "effort_unit": joint.type.effort_unit,
        "follows": follows,
        "limits": {
            name: _finite(getattr(limits, name))
            for name in ("lower", "upper", "speed", "acceleration", "effort")
        },
    }


def _finite(value: float | None) -> float | None:
    """The number, or None where it is unknown (NaN) or no limit (infinite)."""
    return value if value is not None and math.isfinite(value) else None


def _plain(value: Any) -> Any:
    """JSON's own types, numbers that JSON lacks as null."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return _finite(value) if isinstance(value, float) else value


def print_mechanism(found: Mechanism) -> None:
    """Print the joints of a robot file with links and parents, which joints they follow, and whether psdmc can derive
    the robot."""
    count, own = len(found), len(leaders(found.coordinates))
    shape = "a serial chain" if found.is_serial else f"a tree with {len(found.leaves)} ends"
    print_line(f"{found.name}: {shape} of {count} joints with {own} coordinates, from {found.base_name}")
    print()
    rows = []
    for i, joint in enumerate(found.joints):
        limits = joint.limits
        rows.append(
            (
                joint.name,
                joint.link_name,
                found.parent_link(i),
                joint.type.word,
                followed(found, i),
                position_range(limits.lower, limits.upper, joint.type.position_unit),
                "unknown" if math.isnan(found.parameters[i, 0]) else f"{found.parameters[i, 0]:.6g} kg",
            )
        )
    print_table(Table(("joint", "link", "hangs on", "type", "q", "position", "mass"), rows))
    print()
    for note in found.notes:
        print_note(note)
    refused = why_not_derived(found)
    if refused is not None:
        print_line(f"not derived as a whole: {refused}")
        print_line(f"hint: {refused.hint}")
    for leaf in found.leaves if len(found.leaves) > 1 else ():
        moving = len(found.path_to(leaf))
        print_line(f"--tip {shlex.quote(found.joints[leaf].link_name)}: {moving} joints")


def why_not_derived(found: Mechanism) -> InputError | None:
    """Return the error that deriving the whole robot would raise, None if there is none."""
    try:
        require_derivable(found)
    except InputError as refused:
        return refused
    return None
