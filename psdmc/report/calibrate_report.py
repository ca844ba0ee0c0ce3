"""A calibration's report: one self-contained HTML page, and the same numbers as JSON."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psdmc.atomic import write_together
from psdmc.calibration.identify.quality import Quality
from psdmc.calibration.identify.visibility import WEAK
from psdmc.calibration.motions.excite import Excitation
from psdmc.calibration.verdict.record import Calibration, NumberRow
from psdmc.calibration.verdict.said_once import unsaid_warnings
from psdmc.calibration.verdict.verdict import Verdict
from psdmc.emit.render import environment
from psdmc.report.calibrate_plots import excitation_panels, step_panels

CAPTIONS = {
    "Motor": "Torque of the known load, and what the calibrated motors say of the current that it adds (figure 2).",
    "Gravity": "Torque averaged over both directions, against the gravity model (figure 3).",
    "Friction": "Friction of each joint alone, against LuGre (figure 4).",
    "Inertial": "What gravity and friction leave of the fast motion's torque, against the inertial model (figure 5).",
    "All": "The whole torque of the fast motion.",
}

SHADED = "Shaded: held out, not used by the fit. Grey: what is left, observed minus predicted."


@dataclass(frozen=True, slots=True)
class FigureView:
    """Pictures side by side, one a joint or quantity, with their caption."""

    title: str
    panels: tuple[str, ...]
    caption: str


@dataclass(frozen=True, slots=True)
class VerdictView:
    """The verdict's word, its grounds as (kind, text), and its figures joint by joint."""

    word: str
    usable: bool
    lines: tuple[tuple[str, str], ...]
    joint_table: str


@dataclass(frozen=True, slots=True)
class ReportView:
    """The data of the page's template. Tables are finished markup; all other text is escaped there."""

    robot: str
    summary: str
    verdict: VerdictView | None
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    accuracy_table: str
    parameter_table: str
    joint_table: str
    spring_table: str
    fact_table: str
    figures: tuple[FigureView, ...]


def write_report(record: Calibration, path: str | Path, found: Excitation | None = None) -> tuple[Path, Path]:
    """Write the page and, beside it, its numbers as JSON; returns both paths."""
    page = Path(path)
    numbers = page.with_suffix(".json")
    text = json.dumps(record.as_json(), indent=1) + "\n"
    write_together(page.parent, {page.name: report_html(record, found), numbers.name: text})
    return page, numbers


def report_html(record: Calibration, found: Excitation | None = None) -> str:
    """The page as text."""
    figures = [
        FigureView(step.step, step_panels(step), f"{CAPTIONS.get(step.step, '')} {SHADED}")
        for step in record.steps
        if step.samples
    ]
    if found is not None:
        caption = (
            f"Condition number {found.condition:.2f}; the best of {len(found.random_conditions)} random motions "
            f"scaled to the limits has {found.random_conditions[0]:.2f}."
        )
        figures.append(FigureView("Exciting motion", excitation_panels(found, record.joint_names), caption))
    view = ReportView(
        robot=record.robot,
        summary=_summary(record),
        verdict=None if record.verdict is None else verdict_view(record.verdict),
        warnings=unsaid_warnings(record),
        notes=record.notes,
        accuracy_table=accuracy_table(record),
        parameter_table=parameter_table(record),
        joint_table=joint_table(record),
        spring_table=spring_table(record),
        fact_table=fact_table(record),
        figures=tuple(figures),
    )
    template = environment().overlay(autoescape=True).get_template("report/calibration.html.jinja")
    return template.render(view=view)


def verdict_view(verdict: Verdict) -> VerdictView:
    """The first part of the page."""
    kinds = (
        ("not usable", verdict.reasons),
        ("likely", verdict.suspects),
        ("doubt", verdict.doubts),
    )
    lines = tuple((kind, text) for kind, texts in kinds for text in texts)
    return VerdictView(verdict.word, verdict.usable, lines, verdict_table(verdict))


def verdict_table(verdict: Verdict) -> str:
    """The figures by which each joint was judged. A gain in brackets does not count, as the file's torque is too small
    there."""
    head = ["Joint", "R²", "RMSE", "Gain against the file", "Power of friction [W]", "Residual / noise"]
    rows = []
    for joint in verdict.joints:
        gain = _with_std(joint.gain, joint.gain_std)
        rows.append(
            [
                joint.joint,
                _r2(joint.r2),
                _or_dash(joint.rmse),
                gain if joint.visible or gain == "–" else f"({gain})",
                _with_std(joint.friction_power, joint.friction_power_std),
                _or_dash(joint.noise_ratio),
            ]
        )
    return table(head, rows)


def _with_std(value: float, std: float) -> str:
    return f"{value:.3g} ± {std:.1g}" if math.isfinite(value) else "–"


def _or_dash(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "–"


def _logs(record: Calibration) -> str:
    """Names, lengths and dates of the logs."""
    rows = record.facts.get("data", [])
    each = [
        ", ".join(
            filter(None, [row["log"], f"{row['rows']:,} rows", f"{row['seconds']:.4g} s", row["date"], held])
        )
        for row in rows
        for held in ["held out whole" if row.get("use") == "validate" else ""]
    ]
    return f" Logs: {'; '.join(each)}." if each else ""


def _summary(record: Calibration) -> str:
    seen = sum(row.identifiable for row in record.parameters)
    weak = sum(row.visibility == WEAK for row in record.parameters)
    return (
        f"Method: {record.method}. {seen} of {len(record.parameters)} base parameters identified, {weak} weakly visible, "
        f"{len(record.joint_names)} joints.{_logs(record)}"
    )


def accuracy_table(record: Calibration) -> str:
    """Table 3: RMSE and R^2 per joint and step."""
    head = ["Joint", *(f"{step.step}: {what}" for step in record.steps for what in ("RMSE", "R²"))]
    rows = []
    for joint in record.joint_names:
        row = [joint]
        for step in record.steps:
            both = step.joints.get(joint)
            row += ["–", "–"] if both is None else _both(both.held_out, both.fit)
        rows.append(row)
    return table(head, rows)


def _both(held_out: Quality, fit: Quality) -> list[str]:
    return [
        f"{held_out.rmse:.3g} ({fit.rmse:.3g})",
        f"{_r2(held_out.r2)} ({_r2(fit.r2)})",
    ]


def _r2(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.4f}"


def parameter_table(record: Calibration) -> str:
    """Table 4: base parameter, value, uncertainty, equation."""
    head = ["Parameter", "Value", "±", "Relative", "Unit", "Group", "Equation", "In the data"]
    rows = []
    for row in record.parameters:
        numbers = [f"{row.value:.6g}", "–", "–"]
        if math.isfinite(row.std):
            numbers[1:] = [f"{row.std:.2g}", f"{row.relative:.2%}" if row.value else "–"]
        rows.append([row.name, *numbers, row.unit, row.group, row.equation, row.visibility])
    return table(head, rows, text_columns=(6, 7))


def joint_table(record: Calibration) -> str:
    """Table 2: torque constants and friction, joint by joint."""
    names = list(dict.fromkeys(row.name for row in (*record.motors, *record.friction)))
    units = {row.name: row.unit for row in (*record.motors, *record.friction)}
    by_key = {(row.joint, row.name): row for row in (*record.motors, *record.friction)}
    head = ["Joint", *(f"{name.replace('_', ' ')} [{units[name]}]" for name in names)]
    rows = [[joint, *(_number(by_key.get((joint, name))) for name in names)] for joint in record.joint_names]
    return table(head, rows)


def spring_table(record: Calibration) -> str:
    """Values of springs; empty where the fit has none."""
    if not record.springs:
        return ""
    rows = [[row.joint, row.name, _number(row), row.unit] for row in record.springs]
    return table(["Spring", "Quantity", "Value", "Unit"], rows)


def _number(row: NumberRow | None) -> str:
    if row is None:
        return "–"
    if not row.seen:
        word = "given" if row.name == "torque_constant" else row.visibility or "not seen"
        return f"({row.value:.4g}: {word})" if math.isfinite(row.value) else "not identifiable"
    return f"{row.value:.4g} ± {row.std:.1g}"


def fact_table(record: Calibration) -> str:
    """Ranks, condition numbers and the like."""
    return table(
        ["Quantity", "Value"],
        [[name.replace("_", " "), _plain(value)] for name, value in record.facts.items() if name != "data"],
    )


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(_plain(entry) for entry in value)
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_plain(entry)}" for key, entry in value.items())
    return str(value)


def table(head: Sequence[str], rows: Sequence[Sequence[str]], text_columns: tuple[int, ...] = ()) -> str:
    """An HTML table, every cell escaped."""
    lines = [
        "<table>",
        "<tr>" + "".join(f'<th scope="col">{html.escape(cell)}</th>' for cell in head) + "</tr>",
    ]
    for row in rows:
        cells = (
            f'<td class="text">{html.escape(cell)}</td>'
            if k in text_columns
            else f"<td>{html.escape(cell)}</td>"
            for k, cell in enumerate(row)
        )
        lines.append("<tr>" + "".join(cells) + "</tr>")
    return "\n".join([*lines, "</table>"])
