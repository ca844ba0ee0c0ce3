"""Writes what `psdmc validate` and `psdmc compare` print, and the same results as an HTML page and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from psdmc.backends.c.render import environment
from psdmc.calibration.compared import Comparison, Curve
from psdmc.calibration.validation import JointError, Validation
from psdmc.calibration.verdict.changes import Change
from psdmc.files import refuse_foreign_file, write_together
from psdmc.report.calibrate_report import MEASURED, PREDICTED, RESIDUAL, FigureView, panel, step_panels
from psdmc.report.calibrate_tables import number, r_squared, table
from psdmc.report.drawing import Axes, legend_below

Rows = Sequence[Sequence[str]]
MARK = '"schema": 1,\n "kind": "'
"""What the JSON beside every page holds."""


@dataclass(frozen=True, slots=True)
class TableView:
    """A table of the page. The terminal shows the rows `short`; with `prose`, the last column is text."""

    title: str
    head: Sequence[str]
    rows: Rows
    caption: str = ""
    short: Rows = ()
    prose: bool = False

    @property
    def html(self) -> str:
        return table(self.head, self.rows, (len(self.head) - 1,) if self.prose else ())


@dataclass(frozen=True, slots=True)
class PageView:
    """The data of the page's template. Tables and figures are HTML text; the template escapes all other text.

    kind    style of the verdict's box: "", "doubted" or "refused";  document: kind of the JSON file
    lines   (kind, sentence) for the first part of the page;  more: further lines below it
    """

    document: str
    title: str
    head: str
    kind: str
    lines: Sequence[tuple[str, str]]
    more: Sequence[str]
    tables: Sequence[TableView]
    figures: Sequence[FigureView]

    @property
    def text(self) -> list[str]:
        """Return the verdict and its reasons as lines of text, with lines of doubt first."""
        said = [(kind == "doubt", f"  {kind}: {text}") for kind, text in self.lines]
        doubts = [text.strip() for is_doubt, text in said if is_doubt]
        return [*doubts, self.head, *(text for is_doubt, text in said if not is_doubt), *self.more]


def require_free(report: Path) -> None:
    """Raise InputError if the JSON file of a page would replace a JSON file of another kind."""
    numbers = report.with_suffix(".json")
    remedy = f"give --report another name, or move {numbers}: the report's numbers go there"
    refuse_foreign_file(numbers, MARK, remedy)


def write_page(page: PageView, found: Validation | Comparison, report: Path) -> None:
    """Write the HTML page and its JSON file, or neither if one fails."""
    template = environment().overlay(autoescape=True).get_template("report/validation.html.jinja")
    numbers = {"schema": 1, "kind": page.document, **found.as_json()}
    files = {report.name: template.render(view=page)}
    files[report.with_suffix(".json").name] = json.dumps(numbers, indent=1) + "\n"
    write_together(report.parent, files)


def page_of(found: Validation | Comparison) -> PageView:
    """The page of either."""
    return validation_page(found) if isinstance(found, Validation) else comparison_page(found)


def validation_page(found: Validation) -> PageView:
    """Return the HTML page of a validation."""
    in_amperes = any(math.isfinite(j.rms_current) for j in found.joints)
    head = ["Joint", "R²", "RMS error", "Largest", "Moving +", "Moving -", "R² refitted"]
    head += ["RMS [A]", "Largest [A]"] if in_amperes else []
    errors = [
        [
            *(j.joint, r_squared(j.r2), f"{j.rms:.3g} {j.unit}", f"{j.largest:.3g} {j.unit}"),
            *(number(j.forward), number(j.backward), r_squared(j.refitted_r2)),
            *((number(j.rms_current), number(j.largest_current)) if in_amperes else ()),
        ]
        for j in found.joints
    ]
    by_log = [[log, *map(r_squared, values)] for log, values in found.r2_by_log.items()]
    tables = [
        TableView("Error of the prediction", head, errors, ERRORS, errors),
        TableView(
            "R² of each log",
            ["Log", *(j.joint for j in found.joints)],
            by_log[1:] and by_log,
            "",
            by_log[1:] and by_log,
        ),
        TableView("Named changes", CHANGE_HEAD, _changes(found.named), NAMED, prose=True),
        TableView("Changes of all values", CHANGE_HEAD, _changes(found.changes), CHANGES, prose=True),
    ]
    figures = [] if found.quality is None else [FigureView("Torque", step_panels(found.quality), TORQUE)]
    for which, label in (("by_speed", "speed"), ("by_time", "time")):
        panels = tuple(
            panel(partial(_bins, joint=j, which=which), f"error of joint {j.joint} by {label}")
            for j in found.joints
        )
        figures.append(FigureView(f"Error against {label}", panels, BINNED))
    return PageView(
        document="validation",
        title=f"Validation of {found.robot}",
        head=f"verdict: {found.word}",
        kind="refused" if found.exit_status else "doubted" if found.grounds else "",
        lines=found.grounds,
        more=_test("all changes", found, "if the robot is unchanged"),
        tables=[each for each in tables if each.rows],
        figures=figures if found.joints else [],
    )


def _changes(changes: Sequence[Change]) -> Rows:
    return [
        [
            *(c.name, number(c.value), number(c.change), number(c.std), number(c.sigmas), c.unit),
            *(number(c.torque), c.equation),
        ]
        for c in changes
    ]


def _test(what: str, found: Validation | Comparison, unless: str) -> list[str]:
    """The line that says the chi-square test's result; none without a test."""
    if not found.freedom:
        return []
    chance = f"{found.chance:.2g}" if found.chance else "below 1e-300"
    degrees = "1 degree" if found.freedom == 1 else f"{found.freedom} degrees"
    return [f"{what}: chi-square {found.chi2:.4g}, {degrees} of freedom, probability {chance} {unless}"]


ERRORS = (
    "Errors in N m (N if a joint slides), and in A if the torque constant is known. Moving + and -: mean error in either "
    "direction. Refitted: the R² that a new fit of these logs reaches on their last 30 %."
)
CHANGE_HEAD = ["Value", "In the file", "Change", "±", "In ±", "Unit", "Torque", "Equation"]
NAMED = "The verdict's numbers: only these values and a load are fitted to the logs, all others stay those of the file."
CHANGES = (
    "All values are fitted to the logs together, for the chi-square test. So a named value has another change and a larger "
    "± here than in the verdict. ± is one standard deviation of file and logs together. Torque: the largest RMS over the "
    "joints that the change makes."
)
TORQUE = "Blue: observed; orange, dashed: predicted by the file; grey: the difference."
BINNED = "Points: mean of measured minus predicted torque, each of a tenth of the samples. Band: plus and minus the RMS."


def _bins(axis: Axes, joint: JointError, which: str) -> None:
    bins = getattr(joint, which)
    x, mean, rms = (np.array([getattr(each, name) for each in bins]) for name in ("at", "mean", "rms"))
    axis.fill_between(x, -rms, rms, color=RESIDUAL, alpha=0.2, linewidth=0)
    axis.axhline(0.0, color=RESIDUAL, linewidth=0.6)
    axis.plot(x, mean, color=PREDICTED, marker="o", markersize=3, linewidth=1.0)
    _labelled(axis, joint, "error", "time [s]" if which == "by_time" else "")


def _labelled(axis: Axes, joint: JointError | Curve, what: str, x: str = "") -> None:
    axis.set_title(joint.joint, fontsize=11, loc="left")
    axis.set_xlabel(x or ("speed [m/s]" if joint.unit == "N" else "speed [rad/s]"))
    axis.set_ylabel(f"{what} [{joint.unit}]")


def comparison_page(found: Comparison) -> PageView:
    """Return the HTML page of a comparison."""
    joints = [
        [
            *(j.joint, f"{j.rms:.3g} {j.unit}", f"{j.share:.1%}"),
            *(number(j.largest), number(j.gravity), number(j.friction), f"{j.inertia:.1%}"),
        ]
        for j in found.joints
    ]
    logs = [
        [x.joint, *map(r_squared, x.r2), *(f"{v:.3g} {x.unit}" for v in (*x.rms, *x.largest))]
        for x in found.on_log
    ]
    rows = {
        d.name: [d.name, number(d.a), number(d.b), number(d.std), number(d.sigmas), d.unit, d.equation]
        for d in (*found.parameters, *found.friction)
    }
    surely = [rows[d.name] for d in found.surely]
    tables = [
        TableView("Torque over the workspace", JOINT_HEAD, joints, WORKSPACE, joints),
        TableView("Errors on the logs", LOG_HEAD, logs, "", logs),
        TableView(
            "Surely different", VALUE_HEAD, surely, "By more than three standard deviations.", surely, True
        ),
        TableView("All values", VALUE_HEAD, list(rows.values()), VALUES, prose=True),
    ]
    lines = [("doubt", text) for text in found.doubts] + [("noticed", joint.words) for joint in found.noticed]
    panels = tuple(
        panel(partial(_curve, curve=curve), f"friction of joint {curve.joint}") for curve in found.curves
    )
    return PageView(
        document="comparison",
        title=f"{found.robot}: A is {found.a}, B is {found.b}",
        head=f"a controller notices the difference at {len(found.noticed)} of {len(found.joints)} joints",
        kind="doubted" if lines else "",
        lines=lines,
        more=_test("base parameters", found, "if the models are equal"),
        tables=[each for each in tables if each.rows],
        figures=[FigureView("Friction", panels, "Each joint moves alone. Blue: A; orange, dashed: B.")]
        if panels
        else [],
    )


JOINT_HEAD = ["Joint", "RMS of B - A", "of A's", "Largest", "Gravity", "Friction", "Inertia"]
LOG_HEAD = ["Joint", "R² of A", "R² of B", "RMS of A", "RMS of B", "Largest of A", "Largest of B"]
VALUE_HEAD = ["Value", "A", "B", "±", "In ±", "Unit", "Equation"]
WORKSPACE = (
    "Over 2,000 states within the joints' limits. Gravity, friction: RMS of these parts. Inertia: the largest change of the "
    "joint's own inertia."
)
VALUES = "± is the standard deviation of both together; a dash if it is not known."


def _curve(axis: Axes, curve: Curve) -> None:
    axis.plot(curve.speed, curve.a, color=MEASURED, linewidth=1.2, label="A")
    axis.plot(curve.speed, curve.b, color=PREDICTED, linewidth=1.0, linestyle="--", label="B")
    _labelled(axis, curve, "friction")
    legend_below(axis, 2)
