"""Tables that commands print."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from psdmc.cli.one_line import one_line
from psdmc.cli.show_calibration import print_calibration, standard_deviations
from psdmc.errors import InputError
from psdmc.lower.admitted import admitted
from psdmc.lower.kernels import Lowering, lower
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.mass_check import MassCheck
from psdmc.model.summary import Summary, summary, term_texts
from psdmc.program.cost import cost
from psdmc.robot.coordinates import leaders
from psdmc.robot.derivable import require_derivable
from psdmc.robot.mechanism import Mechanism

if TYPE_CHECKING:
    from psdmc.calibration.verdict.record import Calibration
    from psdmc.calibration.verdict.verdict import Verdict
    from psdmc.verification.check import CheckRow

WIDTH = 160
"""Columns of a table where the output is no terminal, so that nothing is cut."""


def console() -> Console:
    terminal = Console()
    return terminal if terminal.is_terminal else Console(width=WIDTH)


def print_model(model: DynamicsModel) -> None:
    """The model at a glance: robot, joints, sizes, base parameters, certificate, notes."""
    found = summary(model)
    out = console()
    calibrated = model.provenance.get("calibration")
    if calibrated is not None:
        print_calibration(out, calibrated)
    out.print(
        f"[bold]{escape(found.name)}[/bold]  {escape(found.base)} to {escape(found.ends)}, {found.convention} frames"
    )
    out.print(f"gravity {_numbers(found.gravity)} m/s^2 in the base frame")
    out.print(_sizes(found))
    out.print(_joints(model.mechanism, found.certificate))
    out.print(_parameters(found, calibrated or {}))
    out.print(f"largest torque error against Newton-Euler, relative: {max(found.certificate):.1e}")
    for note in found.notes:
        out.print(f"note: {escape(note)}")
    for line in _snapping(model):
        out.print(line)
    source = f"{found.source_name} (sha256 {found.source_sha256})" if found.source_name else "not kept"
    out.print(f"source {escape(source)}")
    out.print(f"model hash {found.content_hash}")


def _sizes(found: Summary) -> str:
    if found.sizes is None or found.p is None:
        why = "--no-expand" if found.is_serial else "a tree's are only with --expand"
        if not all(joint.type.about_z for joint in found.joints):
            why = "they are of joints of one coordinate"
        return f"l = {found.l} base parameters; monomials not expanded ({why})"
    parts = ", ".join(f"{count} {kind}" for kind, count in found.sizes._asdict().items())
    return f"p = {found.p} monomials ({parts}), l = {found.l} base parameters, {found.entries} entries of P"


def _joints(robot: Mechanism, errors: Sequence[float]) -> Table:
    """What each joint is; of a tree also the link that it hangs on, and where joints follow others what their q is. `errors`
    nv, of which a joint's largest is shown."""
    heads = ("type", "position", "speed", "acceleration", "effort", "error")
    table = Table(
        "joint",
        "link",
        *(() if robot.is_serial else ("hangs on",)),
        *(("q",) if robot.has_followers else ()),
        *heads,
    )
    for i, joint in enumerate(robot.joints):
        own = [error for k, error in zip(robot.rate_joints, errors, strict=True) if k == i]
        unit = joint.type.position_unit
        limits = joint.limits
        table.add_row(
            escape(joint.name),
            escape(joint.link_name),
            *(() if robot.is_serial else (escape(robot.parent_link(i)),)),
            *((escape(_followed(robot, i)),) if robot.has_followers else ()),
            joint.type.word,
            _range(limits.lower, limits.upper, unit),
            _limit(limits.speed, f"{unit}/s"),
            _limit(limits.acceleration, f"{unit}/s^2"),
            _limit(limits.effort, joint.type.effort_unit),
            f"{max(own):.1e}" if own else "",
        )
    return table


def _parameters(found: Summary, calibrated: Mapping[str, Any]) -> Table:
    stds = standard_deviations(calibrated, len(found.base_parameters))
    heads = ["theta_b", "value", *(["+-"] if calibrated else []), "unit", "equation, about the link frames"]
    table = Table(*heads)
    for index, (parameter, std) in enumerate(zip(found.base_parameters, stds, strict=True), start=1):
        value = "unknown" if parameter.value is None else f"{parameter.value:.6g}"
        given = [std] if calibrated else []
        table.add_row(str(index), value, *given, parameter.unit, escape(parameter.equation))
    return table


def _snapping(model: DynamicsModel) -> list[str]:
    effect = model.provenance.get("snap_torque_change")
    if not model.provenance.get("snapped"):
        return []
    if effect is None:
        return ["snapping: its effect on torques is unknown, as the inertias are"]
    return [f"snapping changed torques by at most {max(effect):.2g} N m"]


def _limit(value: float, unit: str) -> str:
    return "none" if math.isinf(value) else f"{value:.4g} {unit}"


def _range(lower: float, upper: float, unit: str) -> str:
    if math.isinf(lower) and math.isinf(upper):
        return "none"
    return f"{lower:.4g} .. {upper:.4g} {unit}"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:g}" for value in values)


def print_terms(model: DynamicsModel) -> None:
    """Print every monomial y, one a line."""
    for index, text in enumerate(term_texts(model), start=1):
        print(f"y{index} = {text}")


def print_cost(model: DynamicsModel, lowerings: Sequence[Lowering]) -> None:
    """Operations of each function per lowering; for one state, and where they differ for one state per lane."""
    table = Table("function", "lowering", "mul", "add", "mul + add", "div", "sincos", "fused", "in lanes")
    functions, notes = admitted(model)
    for note in notes:
        print(f"note: {note}")
    for lowering in lowerings:
        for name, kernel in lower(model, lowering, functions).items():
            if kernel.lowering == lowering:
                one, lanes = cost(kernel.single), cost(kernel.batch)
                figures = (one.mul, one.add, one.total, one.div, one.sincos, one.fused)
                table.add_row(name, lowering, *map(str, figures), f"{lanes.total} + {lanes.sincos} sincos")
    console().print(table)


def megabytes(size: int) -> str:
    return f"{size / 2**20:.1f} MiB"


def print_check(rows: Sequence[CheckRow]) -> None:
    """Print each comparison, whether it passed, and the readers of the source."""
    from psdmc.verification.check import readers

    table = Table("quantity", "against", "relative error", "limit", "", "")
    for row in rows:
        limit = "" if row.limit is None else f"{row.limit:.0e}"
        error = "" if math.isnan(row.error) and row.limit is None else f"{row.error:.1e}"
        verdict = "" if row.limit is None else "pass" if row.passed else "FAIL"
        table.add_row(row.name, row.against, error, limit, verdict, escape(row.remark))
    out = console()
    out.print(table)
    out.print(readers(rows))


def print_mass_check(mass: MassCheck | None) -> None:
    """Whether the mass matrix is positive definite over the joint limits, or why that was not tested."""
    if mass is None:
        print("mass matrix: not tested, for the base parameters are unknown")
        return
    print(f"{'pass' if mass.passed else 'FAIL'}: {mass.reason}")


def print_verdict(verdict: Verdict) -> None:
    """Print whether a calibration can be used, with reasons and doubts."""
    for line in verdict.lines():
        print(one_line(line))


def print_accuracy(record: Calibration) -> None:
    """R^2 on held-out data per joint and step."""
    table = Table("joint", *(f"{step.step} R^2" for step in record.steps))
    for joint in record.joint_names:
        both = [step.joints.get(joint) for step in record.steps]
        table.add_row(escape(joint), *("" if b is None else f"{b.held_out.r2:.4f}" for b in both))
    console().print(table)


def print_mechanism(found: Mechanism) -> None:
    """What a robot file holds: its bodies, what each hangs on and follows, and whether psdmc derives it."""
    out = console()
    count, own = len(found), len(leaders(found.coordinates))
    shape = "a serial chain" if found.is_serial else f"a tree with {len(found.leaves)} ends"
    name, base = escape(found.name), escape(found.base_name)
    out.print(f"[bold]{name}[/bold]  {shape} of {count} joints with {own} coordinates, from {base}")
    out.print(_bodies(found))
    for note in found.notes:
        out.print(f"note: {escape(note)}")
    try:
        require_derivable(found)
    except InputError as refused:
        out.print(f"not derived as a whole: {escape(str(refused))}")
        out.print(f"hint: {escape(str(refused.hint))}")
    for leaf in found.leaves if len(found.leaves) > 1 else ():
        moving = len(found.path_to(leaf))
        out.print(f"--tip {escape(shlex.quote(found.joints[leaf].link_name))}: {moving} joints")


def _bodies(found: Mechanism) -> Table:
    table = Table("joint", "link", "hangs on", "type", "q", "position", "mass")
    for i, joint in enumerate(found.joints):
        unit, limits = joint.type.position_unit, joint.limits
        table.add_row(
            escape(joint.name),
            escape(joint.link_name),
            escape(found.parent_link(i)),
            joint.type.word,
            escape(_followed(found, i)),
            _range(limits.lower, limits.upper, unit),
            f"{found.parameters[i, 0]:.6g} kg",
        )
    return table


def _followed(found: Mechanism, i: int) -> str:
    coordinate = found.coordinates[i]
    if coordinate.leader is None:
        return f"{coordinate.offset:g}"
    if coordinate.leader == i:
        return "its own"
    offset = (
        f" {'-' if coordinate.offset < 0 else '+'} {abs(coordinate.offset):g}" if coordinate.offset else ""
    )
    return f"{coordinate.ratio:g} q of {found.joints[coordinate.leader].name}{offset}"
