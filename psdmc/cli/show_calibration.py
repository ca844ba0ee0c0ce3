"""First part of `psdmc show` for a calibrated model: its verdict, its data, and how well it follows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from psdmc.cli.next_step import one_line
from psdmc.cli.tables import Table, print_table
from psdmc.model.joined_units import joined_units

MOST_LOGS = 8
"""Logs that are listed; a campaign has thirty."""


def print_calibration(kept: Mapping[str, Any]) -> None:
    """Verdict, logs and their dates, held-out R^2 and residual of every joint, and its friction.

    kept  the `calibration` of a model's provenance; what an older psdmc did not write is left out
    """
    for line in _verdict(kept.get("verdict")):
        print(line)
    print(f"method: {one_line(str(kept.get('method', 'unknown')))}")
    facts = kept.get("facts", {})
    logs = [("log", row) for row in facts.get("data", [])]
    logs += [("log with a known load", row) for row in facts.get("with_load", [])]
    for what, row in logs[:MOST_LOGS]:
        date = f", {row['date']}" if row.get("date") else ""
        held = ", held out whole" if row.get("use") == "validate" else ""
        print(f"{what}: {one_line(row['log'])}, {row['rows']:,} rows, {row['seconds']:.4g} s{date}{held}")
    if len(logs) > MOST_LOGS:
        print(f"and {len(logs) - MOST_LOGS} more logs")
    if kept.get("prediction", {}).get("coupling"):
        print("friction: of the motors, some of which drive several joints together")
    print_table(_joints(kept))
    if kept.get("springs"):
        each = [(one_line(row["spring"]), row["name"], _row(row), row["unit"]) for row in kept["springs"]]
        print_table(Table(("spring", "value", "found", "unit"), each))
    print()


def _verdict(verdict: Mapping[str, Any] | None) -> list[str]:
    if not verdict:
        return ["verdict: none, this model was calibrated by an older psdmc"]
    kinds = (("not usable", "reasons"), ("likely", "suspects"), ("doubt", "doubts"))
    lines = [f"  {word}: {one_line(text)}" for word, kind in kinds for text in verdict.get(kind, [])]
    return [f"verdict: {verdict.get('verdict', 'unknown')}", *lines]


def _joints(kept: Mapping[str, Any]) -> Table:
    """R^2 and RMSE of the whole torque, torque constant and friction, joint by joint."""
    constants = [*kept.get("motors", []), *kept.get("friction", [])]
    units = joined_units((row["name"], row["unit"]) for row in constants)
    by_joint = {(row["joint"], row["name"]): row for row in constants}
    quality = kept.get("quality", {}).get("All", {})
    heads = [f"{name.replace('_', ' ')} [{unit}]" for name, unit in units.items()]
    rows = []
    for joint in kept.get("joints", []):
        held_out = quality.get(joint, {}).get("held_out", {})
        figures = [_number(held_out.get("r2"), ".4f"), _number(held_out.get("rmse"), ".3g")]
        rows.append((joint, *figures, *(_row(by_joint.get((joint, name))) for name in units)))
    return Table(("joint", "R^2 held out", "RMSE held out", *heads), rows)


def _row(row: Mapping[str, Any] | None) -> str:
    """Value and standard deviation; in brackets what the data do not show by itself."""
    if row is None or row.get("value") is None:
        return ""
    std = row.get("std")
    text = f"{row['value']:.4g}" if std is None else f"{row['value']:.4g} +- {std:.1g}"
    return text if row.get("seen", True) else f"({text})"


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def standard_deviations(kept: Mapping[str, Any], count: int) -> Sequence[str]:
    """Describe the standard deviations of the base parameters; empty if the model was not calibrated."""
    rows = kept.get("base_parameters", [])
    if len(rows) != count:
        return [""] * count
    return ["" if row["std"] is None else f"{row['std']:.2g}" for row in rows]
