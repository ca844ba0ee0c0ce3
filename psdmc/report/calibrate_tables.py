"""Makes the tables of a calibration's report as HTML text, with every cell escaped."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import Any

from psdmc.model.calibrated import (
    FRICTION_DRIFT,
    LOG_INFORMATION,
    PROPOSED_COUPLING,
    Calibrated,
    NumberRow,
    Quality,
    Verdict,
)
from psdmc.model.summary import joined_units

NOTHING = "–"
"""A cell without a number."""
OWN_TABLES = (LOG_INFORMATION, FRICTION_DRIFT, PROPOSED_COUPLING, "odd_logs")
"""Facts that the table of facts leaves out."""
USES = {"validate": "held out whole", "with_load": "with the known load"}
"""How a log is used that is not fitted."""


def verdict_table(verdict: Verdict) -> str:
    """Return the table of numbers by which psdmc judged each joint. A gain compares the errors of the robot file with
    those of the calibration. It is in brackets and does not count if the file predicts too small a torque."""
    head = [
        "Joint",
        "R² held out",
        "RMSE held out [N m]",
        "Gain against the file",
        "Power of friction [W]",
        "Residual / noise",
    ]
    rows = []
    for joint in verdict.joints:
        gain = with_std(joint.gain, joint.gain_std)
        rows.append(
            [
                joint.joint,
                r_squared(joint.r2),
                number(joint.rmse),
                gain if joint.visible or gain == NOTHING else f"({gain})",
                with_std(joint.friction_power, joint.friction_power_std),
                number(joint.noise_ratio),
            ]
        )
    return table(head, rows)


def accuracy_table(record: Calibrated) -> str:
    """Return the table of RMSE and R^2 for each joint and calibration step (table 3 of Denso-2022). Numbers are for
    data that were not fitted and, in brackets, for fitted data."""
    head = [
        "Joint",
        *(
            f"{step.step}: {what}"
            for step in record.steps
            for what in ("RMSE held out (fitted)", "R² held out (fitted)")
        ),
    ]
    rows = []
    for joint in record.joint_names:
        row = [joint]
        for step in record.steps:
            both = step.joints.get(joint)
            row += [NOTHING, NOTHING] if both is None else _both(both.held_out, both.fit)
        rows.append(row)
    return table(head, rows)


def _both(held_out: Quality, fit: Quality) -> list[str]:
    return [
        f"{held_out.rmse:.3g} ({fit.rmse:.3g})",
        f"{r_squared(held_out.r2)} ({r_squared(fit.r2)})",
    ]


def parameter_table(record: Calibrated) -> str:
    """Return the table of base parameters with values of file and fit (table 4 of Denso-2022)."""
    head = ["Parameter", "In the file", "Found", "±", "Relative", "Unit", "Equation", "In the data", "Group"]
    rows = []
    for row in record.parameters:
        file = NOTHING if row.file is None else f"{row.file:.6g}"
        numbers = [file, f"{row.value:.6g}", NOTHING, NOTHING]
        if math.isfinite(row.std):
            numbers[2:] = [f"{row.std:.2g}", f"{row.relative:.2%}" if row.value else NOTHING]
        rows.append([row.name, *numbers, row.unit, row.equation, row.visibility, row.group])
    return table(head, rows, text_columns=(6, 7))


def joint_table(record: Calibrated) -> str:
    """Return the table of torque constants, friction and elasticity of each joint (table 2 of Denso-2022)."""
    own = (*record.motors, *record.friction, *record.elasticity)
    units = joined_units((row.name, row.unit) for row in own)
    by_key = {(row.joint, row.name): row for row in own}
    head = ["Joint", *(f"{name.replace('_', ' ')} [{unit}]" for name, unit in units.items())]
    rows = [
        [joint, *(joint_number(by_key.get((joint, name))) for name in units)] for joint in record.joint_names
    ]
    return table(head, rows)


def spring_table(record: Calibrated) -> str:
    """Return the table of fitted spring values; empty if the calibration has no springs."""
    if not record.springs:
        return ""
    rows = [[row.joint, row.name, joint_number(row), row.unit] for row in record.springs]
    return table(["Spring", "Quantity", "Value", "Unit"], rows)


def joint_number(row: NumberRow | None) -> str:
    """Return a joint's value and deviation as text; in brackets with a reason if the data lack it."""
    if row is None:
        return NOTHING
    if not row.seen:
        word = "given" if row.name == "torque_constant" else row.visibility or "not seen"
        return f"({row.value:.4g}: {word})" if math.isfinite(row.value) else "not identifiable"
    return f"{row.value:.4g} ± {row.std:.1g}"


def log_table(record: Calibrated) -> str:
    """Return the names, durations and dates of the logs; empty text if they are unknown."""
    steps = {} if record.prediction is None else record.prediction.steps
    is_split = not steps or any(step.held_out for step in steps.values())
    uses = USES | {"fit": "fitted and held out" if is_split else "fitted"}
    rows = [
        [log.log, f"{log.rows:,}", f"{log.seconds:.4g}", log.date or NOTHING, uses.get(log.use, log.use)]
        for log in record.logs
    ]
    return table(["Log", "Rows", "Duration [s]", "Date", "Used"], rows) if rows else ""


def information_table(record: Calibrated) -> str:
    """Return the table of each log's share in the information of each parameter; empty text for a single log. For each
    parameter, the log without which its standard deviation would grow most comes first."""
    found = record.facts.get(LOG_INFORMATION)
    if found is None:
        return ""
    rows = []
    for row in found["parameters"]:
        grown = [math.inf if value is None else value for value in row["std_without"]]
        most = max(range(len(grown)), key=grown.__getitem__)
        shares = sorted(zip(found["logs"], row["shares"], strict=True), key=lambda each: -each[1])
        words = ", ".join(f"{log} {share:.0%}" for log, share in shares)
        growth = f"{grown[most]:.3g} times" if math.isfinite(grown[most]) else "not determined"
        rows.append([row["name"], found["logs"][most], growth, words])
    head = ["Parameter", "Most important log", "Standard deviation without it", "Shares of all logs"]
    return table(head, rows, text_columns=(0, 3))


def drift_table(record: Calibrated) -> str:
    """Return the table of the change of each joint's friction over each log; empty text if it was not computed."""
    rows = [
        [
            row["log"],
            row["joint"],
            f"{row['seconds']:.4g}",
            f"{with_std(row['change'], row['std'])} {row['unit']}",
            f"{row['share']:+.1%}",
            "yes" if row["shown"] else "no",
        ]
        for row in record.facts.get(FRICTION_DRIFT, ())
    ]
    head = ["Log", "Joint", "Duration [s]", "Change of friction", "Share of friction", "Significant"]
    return table(head, rows) if rows else ""


def step_table(record: Calibrated) -> str:
    """Return the table of calibration steps: the cut-off frequency of the filter, and how the data were split. The text
    is empty if they are unknown."""
    if record.prediction is None:
        return ""
    rows = []
    for name, step in record.prediction.steps.items():
        share = f"{step.held_out:.0%}"
        where = f"{share}, the end" if step.blocks == 0 else f"{share}, spread over {step.blocks} blocks"
        where = where if step.held_out else NOTHING
        title = "whole log" if name == "all" else name
        rows.append([title, f"{step.cutoff:g}", f"{step.order}, both ways", where])
    return table(["Step", "Cut-off [Hz]", "Butterworth order", "Held out"], rows)


def fact_table(record: Calibrated) -> str:
    """Ranks, condition numbers and the like."""
    own = {name: value for name, value in record.facts.items() if name not in OWN_TABLES}
    rows = [[name.replace("_", " "), _plain(value)] for name, value in own.items()]
    return table(["Quantity", "Value"], rows, text_columns=(1,))


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(_plain(entry) for entry in value)
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_plain(entry)}" for key, entry in value.items())
    return str(value)


def with_std(value: float, std: float) -> str:
    """A number and its standard deviation."""
    return f"{value:.3g} ± {std:.1g}" if math.isfinite(value) else NOTHING


def number(value: float) -> str:
    """Return a number as text with three digits; a dash if it is not finite."""
    return f"{value:.3g}" if math.isfinite(value) else NOTHING


def r_squared(value: float) -> str:
    """Return R^2 as text with four decimals; a dash if there is none."""
    return NOTHING if math.isnan(value) else f"{value:.4f}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]], text_columns: tuple[int, ...] = ()) -> str:
    """Return an HTML table with every cell escaped. Columns of text are wrapped; columns of numbers are not."""
    names = "".join(_cell("th", cell, k in text_columns, ' scope="col"') for k, cell in enumerate(head))
    lines = ['<table class="plain">', f"<thead><tr>{names}</tr></thead>", "<tbody>"]
    for row in rows:
        cells = "".join(_cell("td", cell, k in text_columns) for k, cell in enumerate(row))
        lines.append(f"<tr>{cells}</tr>")
    return "\n".join([*lines, "</tbody>", "</table>"])


def _cell(tag: str, text: str, is_text: bool, attributes: str = "") -> str:
    kind = ' class="text"' if is_text else ""
    return f"<{tag}{attributes}{kind}>{html.escape(text)}</{tag}>"
