"""Describes a model or robot file for `psdmc show`, as text and as JSON."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Sequence
from typing import Any

from psdmc.cli.console import one_line
from psdmc.cli.tables import TERMS, Table, print_line, print_note, print_table
from psdmc.errors import InputError
from psdmc.lower.admitted import admitted
from psdmc.lower.kernels import Lowering, lower
from psdmc.model.calibrated import WHOLE, Calibrated, NumberRow, Quality, Verdict
from psdmc.model.calibrated_json import document
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.equations import BaseParameters
from psdmc.model.summary import (
    joined_units,
    limit_text,
    numbers_text,
    range_text,
    sizes_of,
    term_texts,
)
from psdmc.program.cost import cost
from psdmc.robot.limits import listed
from psdmc.robot.mechanism import POINT, Joint, Mechanism, require_derivable


def print_model(model: DynamicsModel) -> None:
    """Print a summary of a model: its robot, joints, sizes, base parameters, certificate and notes."""
    robot, calibrated = model.mechanism, model.calibrated
    if calibrated is not None:
        print_calibration(calibrated)
    ends = "" if robot.is_serial else f"{len(robot.leaves)} ends, tip "
    print_line(f"{robot.name}: {robot.base_name} to {ends}{robot.tip_name}, {robot.convention} frames")
    print_line(f"gravity {numbers_text(robot.gravity.tolist())} m/s^2 in the {robot.base_frame}")
    if model.contacts != dict.fromkeys(model.frame_names, POINT):
        kinds = (
            f"{name} ({'point' if rows == POINT else 'surface'})" for name, rows in model.contacts.items()
        )
        print_line(f"contacts: {', '.join(kinds)}")
    print("\n".join(_sizes(model)))
    print()
    print_table(_joints(robot, joint_errors(robot, model.certificate.tolist())))
    print()
    print_table(_parameters(model.base_parameters, calibrated))
    for line in _unknowns(model):
        print_line(line)
    print()
    print_loop_base_parameters(model, combinations=True)
    print_line(f"largest torque error against Newton-Euler, relative: {max(model.certificate.tolist()):.1e}")
    for note in robot.notes:
        print_note(note)
    for line in _snapping(model):
        print_line(line)
    source = model.provenance.get("source_name")
    print_line(f"source: {source or 'not kept'}")
    if source:
        print_line(f"source's sha256: {model.provenance.get('source_sha256')}")
    print_line(f"model hash: {model.content_hash}")


def _sizes(model: DynamicsModel) -> list[str]:
    expansion = model.expansion
    if expansion is None:
        why = "--no-expand" if model.mechanism.is_serial else "a tree's are only with --expand"
        if not all(kind.about_z for kind in model.mechanism.types):
            why = "they are of joints of one coordinate"
        return [f"l = {model.l} base parameters; monomials not expanded ({why})"]
    parts = ", ".join(f"{count} {kind}" for kind, count in sizes_of(expansion.E)._asdict().items())
    return [
        f"p = {model.p} monomials ({parts})",
        f"l = {model.l} base parameters, {len(expansion.entries.value)} entries of P",
    ]


def joint_errors(robot: Mechanism, certificate: Sequence[float]) -> list[float | None]:
    """Return, for each joint, its largest torque error in the model's certificate (nv,), which has one error per joint
    rate.

    The certificate compares the model's torques with those of the Newton-Euler algorithm. The result is None for a
    joint that has no rate, such as a mimic joint.
    """
    of_joint = [
        [error for k, error in zip(robot.rate_joints, certificate, strict=True) if k == i]
        for i in range(len(robot))
    ]
    return [max(own, default=None) for own in of_joint]


def _joints(robot: Mechanism, errors: Sequence[float | None]) -> Table:
    """Print the joints. For a tree it adds the link that carries each, and for joints that follow others their q."""
    heads = (
        *("joint", "link"),
        *(() if robot.is_serial else ("hangs on",)),
        *(("q",) if robot.has_mimic_joints else ()),
        *("type", "position", "speed", "acceleration", "effort", "error"),
    )
    rows = []
    for i, (joint, error) in enumerate(zip(robot.joints, errors, strict=True)):
        unit, limits = joint.type.position_unit, joint.limits
        rows.append(
            (
                joint.name,
                joint.link_name,
                *(() if robot.is_serial else (robot.parent_link(i),)),
                *((followed(robot, i),) if robot.has_mimic_joints else ()),
                joint.type.word,
                range_text(limits.lower, limits.upper, unit),
                limit_text(limits.speed, f"{unit}/s"),
                limit_text(limits.acceleration, f"{unit}/s^2"),
                limit_text(limits.effort, joint.type.effort_unit),
                "" if error is None else f"{error:.1e}",
            )
        )
    return Table(heads, rows)


def _parameters(parameters: BaseParameters, calibrated: Calibrated | None) -> Table:
    """theta_b, numbered from 0 as in the generated header and in Python."""
    stds = standard_deviations(calibrated, len(parameters))
    heads = ("theta_b", "value", *(["+-"] if calibrated else []), "unit", "equation, about the link frames")
    rows = []
    for index, (parameter, std) in enumerate(zip(parameters, stds, strict=True)):
        value = "unknown" if parameter.value is None else f"{parameter.value:.6g}"
        given = [std] if calibrated else []
        rows.append((str(index), value, *given, parameter.unit, parameter.equation))
    return Table(heads, rows, prose=True, breaks=TERMS)


def _unknowns(model: DynamicsModel) -> list[str]:
    """How many base parameters contain unknowns, and of which links."""
    count = len(model.unknown_base_parameters)
    if not count:
        return []
    rows = zip(model.mechanism.joints, model.mechanism.parameters, strict=True)
    links = [joint.link_name for joint, row in rows if any(map(math.isnan, row))]
    return [f"{count} of {model.l} base parameters contain unknown parameters of {listed(links)}"]


def print_loop_base_parameters(model: DynamicsModel, combinations: bool = False) -> None:
    """Print how many base parameters can be identified from the motors' torques of a mechanism with closed loops.

    combinations  True: print also the combinations of several base parameters that can be identified
    """
    if not model.loops:
        return
    try:
        found = model.loop_base_parameters
    except InputError as error:
        print_note(f"{error.message}; psdmc cannot count the base parameters that can be identified")
        return
    print_line(str(found))
    if not combinations:
        return
    several = [
        (str(k), text) for k, text in zip(found.kept, found.combinations(), strict=True) if " " in text
    ]
    if several:
        alone = found.count - len(several)
        print_line(f"{alone} of them can be identified alone, and {len(several)} in these combinations:")
        print_table(Table(("theta_b", "combination"), several, prose=True, breaks=TERMS))
    print()


def _loop_base_parameters_json(model: DynamicsModel) -> dict[str, Any] | None:
    """The kept base parameters and the combinations; None for a robot without loops, or if no closed position is found."""
    if not model.loops:
        return None
    try:
        found = model.loop_base_parameters
    except InputError:
        return None
    return {"count": found.count, "kept": list(found.kept), "combinations": list(found.combinations())}


def _snapping(model: DynamicsModel) -> list[str]:
    effect = model.provenance.get("snap_torque_change")
    if not model.provenance.get("snapped"):
        return []
    if effect is None:
        return ["snapping: its effect on torques is unknown, as the inertias are"]
    return [f"snapping changed torques by at most {max(effect):.2g} N m"]


def followed(found: Mechanism, i: int) -> str:
    """Describe on what the position of joint i depends: on its own coordinate, on another joint, or on a fixed number."""
    coordinate = found.coordinates[i]
    if coordinate.leader is None:
        return f"{coordinate.offset:g}"
    if coordinate.leader == i:
        return "its own"
    return coordinate.in_words(found.joint_names, "q of ")


def print_terms(model: DynamicsModel) -> None:
    """Print every monomial y, one a line."""
    for index, text in enumerate(term_texts(model), start=1):
        print(f"y{index} = {text}")


COSTS = ("mul", "add", "total", "div", "sincos", "fused")
"""Counts of psdmc.program.cost.Cost that are shown."""


def cost_rows(
    model: DynamicsModel, lowerings: Sequence[Lowering]
) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Return the number of operations of each function for each lowering, that is, each way to generate the arithmetic.

    Counts are for one state, and per state in SIMD code. The second result has the functions that are left out, with
    the reason.
    """
    rows = []
    functions, notes = admitted(model)
    for lowering in lowerings:
        for name, kernel in lower(model, lowering, functions).items():
            if kernel.lowering == lowering and not kernel.is_loop_of_calls:
                one, lanes = cost(kernel.single), cost(kernel.batch)
                counts = {key: getattr(one, key) for key in COSTS}
                in_lanes = {"total": lanes.total, "sincos": lanes.sincos}
                rows.append({"function": name, "lowering": lowering, **counts, "lanes": in_lanes})
    return rows, tuple(notes)


def print_cost(model: DynamicsModel, lowerings: Sequence[Lowering]) -> None:
    """Print the operations of each function for each lowering."""
    rows, notes = cost_rows(model, lowerings)
    for note in notes:
        print_line(f"note: {note}")
    texts = [
        (
            row["function"],
            row["lowering"],
            *(str(row[key]) for key in COSTS),
            f"{row['lanes']['total']} + {row['lanes']['sincos']} sincos",
        )
        for row in rows
    ]
    heads = ("function", "lowering", "mul", "add", "mul + add", "div", "sincos", "fused", "in lanes")
    print_table(Table(heads, texts, keys=2))


MOST_LOGS = 8
"""Logs that are listed; a campaign has thirty."""


def print_calibration(found: Calibrated) -> None:
    """Print the verdict, the logs and their dates, and R^2 on held-out data, residual and friction of every joint. Leave
    out what an older version of psdmc did not save."""
    for line in _verdict(found.verdict):
        print(line)
    print(f"method: {one_line(found.method)}")
    for log in found.logs[:MOST_LOGS]:
        what = "log with a known load" if log.use == "with_load" else "log"
        date = f", {log.date}" if log.date else ""
        held = ", held out whole" if log.use == "validate" else ""
        print(f"{what}: {one_line(log.log)}, {log.rows:,} rows, {log.seconds:.4g} s{date}{held}")
    if len(found.logs) > MOST_LOGS:
        print(f"and {len(found.logs) - MOST_LOGS} more logs")
    if found.prediction is not None and found.prediction.coupling:
        print("friction: of the motors, some of which drive several joints together")
    print_table(_calibrated_joints(found))
    if found.springs:
        print_table(_springs(found.springs))
    print()


def _verdict(verdict: Verdict | None) -> list[str]:
    if verdict is None:
        return ["verdict: none, this model was calibrated by an older psdmc"]
    return [one_line(line) for line in verdict.lines()]


def _calibrated_joints(found: Calibrated) -> Table:
    """R^2 and RMSE of the whole torque, torque constant, friction and elasticity, joint by joint."""
    constants = [*found.motors, *found.friction, *found.elasticity]
    units = joined_units((row.name, row.unit) for row in constants)
    by_joint = {(row.joint, row.name): row for row in constants}
    quality = {step.step: step.joints for step in found.steps}.get(WHOLE, {})
    heads = [f"{name.replace('_', ' ')} [{unit}]" for name, unit in units.items()]
    rows = []
    for joint in found.joint_names:
        held_out = quality[joint].held_out if joint in quality else Quality(math.nan, math.nan)
        figures = [_number(held_out.r2, ".4f"), _number(held_out.rmse, ".3g")]
        rows.append((joint, *figures, *(_row(by_joint.get((joint, name))) for name in units)))
    return Table(("joint", "R^2 held out", "RMSE held out", *heads), rows)


def _springs(rows: Sequence[NumberRow]) -> Table:
    """A line for each value of a spring."""
    each = [(one_line(row.joint), row.name, _row(row), row.unit) for row in rows]
    return Table(("spring", "value", "found", "unit"), each)


def _row(row: NumberRow | None) -> str:
    """Value and standard deviation; in brackets what the data do not show by itself."""
    if row is None or not math.isfinite(row.value):
        return ""
    text = f"{row.value:.4g} +- {row.std:.1g}" if math.isfinite(row.std) else f"{row.value:.4g}"
    return text if row.seen else f"({text})"


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else ""


def standard_deviations(found: Calibrated | None, count: int) -> Sequence[str]:
    """Describe the standard deviations of the base parameters; empty if the model was not calibrated."""
    if found is None or len(found.parameters) != count:
        return [""] * count
    return [f"{std:.2g}" if math.isfinite(std) else "" for std in found.std]


# The same as JSON
#
# One document, all numbers with all digits, null for unknown values.


SCHEMA = 1
"""Of the documents: it grows where a key goes or means something else; further keys may come."""


def print_json(kind: str, content: dict[str, Any]) -> None:
    """Print one JSON document in ASCII: its `kind`, which says what it describes, and the content."""
    document = {"schema": SCHEMA, "kind": kind, **content}
    print(json.dumps(document, indent=2, ensure_ascii=True, allow_nan=False))


def model_json(model: DynamicsModel) -> dict[str, Any]:
    """Return what `psdmc show --json` prints for a model."""
    robot, expansion, kept = model.mechanism, model.expansion, model.provenance
    certificate = model.certificate.tolist()
    errors = joint_errors(robot, certificate)
    joints = [{**joint, "error": error} for joint, error in zip(_joint_rows(robot), errors, strict=True)]
    values = kept.get("snap_torque_change")
    return {
        "name": robot.name,
        "base": robot.base_name,
        "tip": robot.tip_name,
        "convention": robot.convention,
        "gravity_m_s2": robot.gravity.tolist(),
        "joints": joints,
        "frames": [frame.name for frame in robot.frames],
        "contacts": model.contacts,
        "p": model.p,
        "l": model.l,
        "monomials": None if expansion is None else sizes_of(expansion.E)._asdict(),
        "entries_of_P": None if expansion is None else len(expansion.entries.value),
        "base_parameters": model.base_parameters.plain(),
        "loop_base_parameters": _loop_base_parameters_json(model),
        "largest_torque_error": max(certificate),
        "snap_torque_change": None if values is None else [_finite(float(value)) for value in values],
        "notes": list(robot.notes),
        "calibration": None if model.calibrated is None else document(model.calibrated),
        "source": {"name": kept.get("source_name"), "sha256": kept.get("source_sha256")},
        "options": _plain(kept.get("options")),
        "model_hash": model.content_hash,
    }


def mechanism_json(robot: Mechanism) -> dict[str, Any]:
    """Return what `psdmc show --json` prints for a robot file."""
    refused = why_not_derived(robot)
    joints = [
        {**joint, "mass_kg": _finite(float(row[0]))}
        for joint, row in zip(_joint_rows(robot), robot.parameters, strict=True)
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
    """Return the monomials y of a model's torques as texts, in the order of matrix E's columns."""
    return {"terms": list(term_texts(model))}


def cost_json(model: DynamicsModel, lowerings: Sequence[Lowering]) -> dict[str, Any]:
    """Operations of each function per lowering."""
    rows, notes = cost_rows(model, lowerings)
    return {"functions": rows, "notes": list(notes)}


def _joint_rows(robot: Mechanism) -> list[dict[str, Any]]:
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
    """Print a robot file's joints with links, parents and followed joints, and whether psdmc can derive it."""
    count, own = len(found), found.nv
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
                range_text(limits.lower, limits.upper, joint.type.position_unit),
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
