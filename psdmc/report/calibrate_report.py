"""The report of a calibration: an HTML page without external files, and the same numbers as JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from psdmc.backends.c.render import environment
from psdmc.calibration.motions.excite import Excitation
from psdmc.files import refuse_foreign_file, write_together
from psdmc.model.calibrated import PROPOSED_COUPLING, WEAK, Calibrated, Verdict, code_of
from psdmc.model.calibrated_json import document
from psdmc.report.calibrate_plots import excitation_panels, step_panels
from psdmc.report.calibrate_tables import (
    accuracy_table,
    drift_table,
    fact_table,
    information_table,
    joint_table,
    log_table,
    parameter_table,
    spring_table,
    step_table,
    verdict_table,
)
from psdmc.report.truth import TruthView

CAPTIONS = {
    "Motor": "Torque of the known load, and what the calibrated motors say of the current that it adds (figure 2).",
    "Gravity": "Torque averaged over both directions, against the gravity model (figure 3).",
    "Friction": "Friction of each joint alone, against its law (figure 4).",
    "Inertial": "What gravity and friction leave of the fast motion's torque, against the inertial model (figure 5).",
    "All": "The whole torque of the fast motion.",
}

NUMBERS_MARK = '"base_parameters": [\n  {\n   "name": "theta_b[0]"'
"""What the JSON beside every page holds."""


@dataclass(frozen=True, slots=True)
class FigureView:
    """Pictures that the page shows next to each other, one per joint or quantity, and their caption."""

    title: str
    panels: tuple[str, ...]
    caption: str


@dataclass(frozen=True, slots=True)
class VerdictView:
    """The verdict of a calibration: its word, the reasons as (kind, text), and the numbers for each joint."""

    word: str
    usable: bool
    lines: tuple[tuple[str, str], ...]
    joint_table: str


@dataclass(frozen=True, slots=True)
class ReportView:
    """The data of the report's template. Tables are HTML text, empty if there is nothing to show. The template of the
    page escapes all other text.

    truth     true parameters, which only a virtual robot has; None for logs of a real robot
    proposed_coupling  lines of a log description that psdmc proposes; empty if there are none
    versions  names and versions of the programs that computed the result
    """

    robot: str
    summary: str
    truth: TruthView | None
    verdict: VerdictView | None
    proposed_coupling: str
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    accuracy_table: str
    parameter_table: str
    joint_table: str
    spring_table: str
    log_table: str
    information_table: str
    drift_table: str
    step_table: str
    versions: tuple[str, ...]
    fact_table: str
    figures: tuple[FigureView, ...]


def write_report(
    record: Calibrated, path: str | Path, found: Excitation | None = None, truth: TruthView | None = None
) -> tuple[Path, Path]:
    """Write the HTML page and a JSON file with its numbers next to it. Return both paths."""
    page = Path(path)
    numbers = page.with_suffix(".json")
    text = json.dumps(document(record), indent=1) + "\n"
    write_together(page.parent, {page.name: report_html(record, found, truth), numbers.name: text})
    return page, numbers


def require_free_numbers(page: str | Path) -> None:
    """Raise InputError if the JSON file of a report would replace a file that is not the JSON file of a report."""
    numbers = Path(page).with_suffix(".json")
    remedy = f"give --report another name, or move {numbers}: the report's numbers go there"
    refuse_foreign_file(numbers, NUMBERS_MARK, remedy)


def report_html(record: Calibrated, found: Excitation | None = None, truth: TruthView | None = None) -> str:
    """The page as text."""
    view = ReportView(
        robot=record.robot,
        summary=_summary(record),
        truth=truth,
        verdict=None if record.verdict is None else verdict_view(record.verdict),
        proposed_coupling=record.facts.get(PROPOSED_COUPLING, {"toml": ""})["toml"],
        warnings=record.unsaid,
        notes=record.notes,
        accuracy_table=accuracy_table(record),
        parameter_table=parameter_table(record),
        joint_table=joint_table(record),
        spring_table=spring_table(record),
        log_table=log_table(record),
        information_table=information_table(record),
        drift_table=drift_table(record),
        step_table=step_table(record),
        versions=tuple(f"{name} {value}" for name, value in record.versions.items()),
        fact_table=fact_table(record),
        figures=_figures(record, found),
    )
    template = environment().overlay(autoescape=True).get_template("report/calibration.html.jinja")
    return template.render(view=view)


def _figures(record: Calibrated, found: Excitation | None) -> tuple[FigureView, ...]:
    figures = [
        FigureView(step.step, step_panels(step), CAPTIONS.get(step.step, ""))
        for step in record.steps
        if step.samples
    ]
    if found is not None:
        caption = f"Condition number {found.condition:.2f}. Compared: {found.comparison}."
        figures.append(FigureView("Exciting motion", excitation_panels(found, record.joint_names), caption))
    return tuple(figures)


def verdict_view(verdict: Verdict) -> VerdictView:
    """The first part of the page."""
    return VerdictView(verdict.word, verdict.usable, verdict.grounds, verdict_table(verdict))


def _summary(record: Calibrated) -> str:
    seen = sum(row.identifiable for row in record.parameters)
    weak = sum(code_of(row.visibility) == WEAK.code for row in record.parameters)
    logs = record.logs
    length = f"{sum(log.seconds for log in logs):.4g} s in {len(logs)} log(s). " if logs else ""
    return (
        f"Method: {record.method}. {length}{seen} of {len(record.parameters)} base parameters identified, {weak} weakly "
        f"visible, {len(record.joint_names)} joints."
    )
