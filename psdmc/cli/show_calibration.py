"""First part of `psdmc show` for a calibrated model: its verdict, its data, and how well it follows them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from psdmc.cli.one_line import one_line
from psdmc.cli.tables import Table, print_table
from psdmc.model.calibrated import WHOLE, Calibrated, NumberRow, Quality, Verdict
from psdmc.model.joined_units import joined_units

MOST_LOGS = 8
"""Logs that are listed; a campaign has thirty."""


def print_calibration(found: Calibrated) -> None:
    """Print verdict, logs and their dates, held-out R^2 and residual of every joint, and its friction; what an older psdmc
    did not write is left out."""
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
    print_table(_joints(found))
    if found.springs:
        print_table(_springs(found.springs))
    print()


def _verdict(verdict: Verdict | None) -> list[str]:
    if verdict is None:
        return ["verdict: none, this model was calibrated by an older psdmc"]
    return [one_line(line) for line in verdict.lines()]


def _joints(found: Calibrated) -> Table:
    """R^2 and RMSE of the whole torque, torque constant and friction, joint by joint."""
    constants = [*found.motors, *found.friction]
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
