"""The report of a calibration: an HTML page without external files, and the same numbers as JSON. Its pictures are SVG
text, like figures 2 to 5 of Denso-2022."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from psdmc.backends.c.render import environment
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.excite import MEASURES, Excitation
from psdmc.files import refuse_foreign_file, write_together
from psdmc.model.calibrated import PROPOSED_COUPLING, WEAK, Calibrated, Sample, StepQuality, code_of
from psdmc.model.calibrated_json import document
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
from psdmc.report.drawing import Axes, Figure, legend_below, svg
from psdmc.report.drawing import document as picture_files
from psdmc.report.truth import TruthView
from psdmc.robot.mechanism import Limits

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
    verdict = record.verdict
    view = ReportView(
        robot=record.robot,
        summary=_summary(record),
        truth=truth,
        verdict=None
        if verdict is None
        else VerdictView(verdict.word, verdict.usable, verdict.grounds, verdict_table(verdict)),
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


def _summary(record: Calibrated) -> str:
    seen = sum(row.identifiable for row in record.parameters)
    weak = sum(code_of(row.visibility) == WEAK.code for row in record.parameters)
    logs = record.logs
    length = f"{sum(log.seconds for log in logs):.4g} s in {len(logs)} log(s). " if logs else ""
    return (
        f"Method: {record.method}. {length}{seen} of {len(record.parameters)} base parameters identified, {weak} weakly "
        f"visible, {len(record.joint_names)} joints."
    )


# Pictures


POINTS = 600
"""Points drawn per curve; more would only make the file larger."""

MEASURED, PREDICTED, RESIDUAL, HELD_OUT = "#4878a8", "#d95f02", "#888888", "#c9a227"
SHADE = 0.2
"""Opacity of held-out stretches, on light and dark pages."""

PANEL = (5.2, 2.6)
"""inches: narrow, so that labels stay readable on a phone."""

WHAT = "observed and predicted torque of joint"

MOST_TIMES = 50.0
"""Where the comparison with random motions ends; worse ones count there."""

LIMIT_LINE = "limit"
"""Name of the lines of joints' limits in a picture."""

FILE = (11, 6)
"""inches, of a picture that is a file."""


def step_panels(step: StepQuality) -> tuple[str, ...]:
    """Draw the measured torque, the predicted torque and their difference for each joint, over time. Parts of the log
    that were kept out of the fit are shaded."""
    return tuple(
        panel(partial(_sample, sample=sample), f"{step.step}: {WHAT} {sample.joint}")
        for sample in step.samples
    )


def panel(draw: Callable[[Axes], None], says: str) -> str:
    """Return a picture with one drawing as an <svg> element; `says` is the description for screen readers."""
    return svg(lambda figure: draw(figure.subplots()), PANEL, says)


def _sample(axis: Axes, sample: Sample) -> None:
    order = (
        np.argsort(sample.x, kind="stable")
        if sample.abscissa.startswith("position")
        else np.arange(len(sample.x))
    )
    kept = order[thinned(len(order))]
    x = sample.x[kept]
    _shade(axis, x, sample.held_out[kept])
    axis.plot(x, sample.measured[kept], color=MEASURED, linewidth=1.2, label="observed")
    axis.plot(x, sample.predicted[kept], color=PREDICTED, linewidth=0.8, linestyle="--", label="predicted")
    residual = sample.measured[kept] - sample.predicted[kept]
    axis.plot(x, residual, color=RESIDUAL, linewidth=0.6, label="residual")
    axis.set_title(sample.joint, fontsize=11, loc="left")
    axis.set_xlabel(sample.abscissa)
    axis.set_ylabel("torque [N m]")
    legend_below(axis, 4)


def thinned(count: int) -> Array:
    """Return the indices of evenly spread points, or of all points if they are few."""
    return np.unique(np.linspace(0, count - 1, min(count, POINTS)).astype(int))


def _shade(axis: Axes, x: Array, held_out: Array) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held_out.astype(int), [0]])))
    for k, (first, last) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        label = "_held out" if k else "held out"  # one line in the legend
        axis.axvspan(
            x[first], x[min(last, len(x) - 1)], color=HELD_OUT, alpha=SHADE, linewidth=0, label=label
        )


def excitation_panels(
    found: Excitation, joint_names: Sequence[str], limits: Sequence[Limits] = ()
) -> tuple[str, ...]:
    """Draw positions, speeds and accelerations of the exciting motion with the joint limits, if known. Compare the
    motion with random motions, too."""
    return tuple(
        panel(draw, f"exciting motion: {says}") for says, draw in _excitation(found, joint_names, limits)
    )


def excitation_figure(found: Excitation, joint_names: Sequence[str], limits: Sequence[Limits] = ()) -> bytes:
    """Draw the same four pictures in one SVG file."""

    def draw(figure: Figure) -> None:
        panels = _excitation(found, joint_names, limits)
        for axis, (_, panel) in zip(figure.subplots(2, 2).flat, panels, strict=True):
            panel(axis)

    return picture_files("excitation", draw, FILE, ["svg"])["excitation.svg"]


def limit_lines(limits: Sequence[Limits]) -> tuple[list[tuple[float, float]], ...]:
    """Return the limits of each joint for drawing: (lowest, highest) position, speed and acceleration."""
    positions = [(each.lower, each.upper) for each in limits]
    speeds = [(-each.speed, each.speed) for each in limits]
    return positions, speeds, [(-each.acceleration, each.acceleration) for each in limits]


def _excitation(
    found: Excitation, joint_names: Sequence[str], limits: Sequence[Limits]
) -> list[tuple[str, Callable[[Axes], None]]]:
    """Return what each picture says and how it is drawn."""
    motion = found.motion.sampled(tuple(joint_names), found.motion.duration / 400)
    positions, speeds, accelerations = limit_lines(limits)

    def curves(label: str, values: Array, lines: list[tuple[float, float]]) -> Callable[[Axes], None]:
        def draw(axis: Axes) -> None:
            for k, name in enumerate(joint_names):
                axis.plot(motion.time, values[:, k], linewidth=0.9, color=f"C{k}", label=name)
            for k, pair in enumerate(lines):
                for value in pair:
                    if math.isfinite(value):
                        axis.axhline(
                            value, linewidth=0.7, linestyle=(0, (4, 3)), color=f"C{k}", gid=LIMIT_LINE
                        )
            axis.set_xlabel("time [s]" + ("; dashed: limits" if lines else ""))
            axis.set_ylabel(label)
            if values is motion.q:
                legend_below(axis, 3, 7)

        return draw

    def compared(axis: Axes) -> None:
        random = found.random_times[np.isfinite(found.random_times)]
        axis.hist(np.minimum(random, MOST_TIMES), bins=40, color=RESIDUAL)
        axis.axvline(1.0, color=PREDICTED, linewidth=1.5)
        axis.set_xlabel(f"{MEASURES[found.objective]},\ndivided by that of the planned motion (line)")
        axis.set_ylabel("random motions")

    return [
        ("positions", curves("position [rad]", motion.q, positions)),
        ("speeds", curves("speed [rad/s]", motion.qd, speeds)),
        ("accelerations", curves("acceleration [rad/s²]", motion.qdd, accelerations)),
        ("comparison with random motions", compared),
    ]
