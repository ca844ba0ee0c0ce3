"""Figures (PDF, SVG) and tables (LaTeX) of a calibration, for a report or a paper. The same model file gives the same
bytes, because dates are left out and identifiers are fixed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from psdmc.calibration.sources import LogNaming
from psdmc.calibration.validation import opened_logs
from psdmc.calibration.verdict.delivered import delivered, delivered_quality
from psdmc.errors import InputError
from psdmc.files import refuse_foreign_folder, write_together
from psdmc.friction.joints import rows_of
from psdmc.friction.law import Array, At, Row, total
from psdmc.friction.terms import OPTIONAL
from psdmc.model.calibrated import Calibrated, NumberRow, ParameterRow, StepQuality
from psdmc.model.dynamics_model import DynamicsModel
from psdmc.model.equations import terms_latex
from psdmc.progress import Progress, silent
from psdmc.report.calibrate_report import MEASURED, PREDICTED, RESIDUAL, thinned
from psdmc.report.drawing import Figure, document
from psdmc.robot.limits import shown

MARK = "% written by psdmc figures"
"""First line of every table."""
TABLE = "parameters.tex"
"""The table by which a folder is known as psdmc's."""
DEVIATIONS = 2.0
"""Standard deviations that a bar reaches to each side: 95 % of a normal distribution."""
DIGITS = 2
"""Of a standard deviation in tables."""
TIMES_SPEED = 3.0
"""Largest speed of friction curves, in RMS speeds of the joint's logs."""
TICKS = 4
"""To each side of zero."""
CURVE = 201
"""Points of each half of a friction curve."""
LINE, HALF, FULL = 0.22, 2.4, 7.0
"""inches: height of a parameter's line, height of a joint's picture, width of all."""
ABREAST = 3
"""Friction curves in a row."""


def write_figures(
    model: DynamicsModel, folder: str | Path, log: str | Path | None = None, progress: Progress = silent
) -> list[Path]:
    """Write figures and tables of a calibrated model into a folder, and return their paths.

    log   a log, log description or campaign, from which measured and predicted torque are drawn too

    Raise InputError if the model is not calibrated, the log cannot be used, or the folder has files that are not
    psdmc's.
    """
    known = model.calibrated
    if known is None:
        raise InputError(f"{shown(model.mechanism.name)}: not calibrated", "run `psdmc calibrate` first")
    require_own_folder(folder)
    progress("reading the log")
    torque = None if log is None else _torque(model, log, progress)
    progress("drawing")
    files: dict[str, str | bytes] = dict(tables(model, known))
    high = 1.2 * len({row.unit for row in known.parameters}) + LINE * len(known.parameters)
    pictures = {"parameters": (partial(draw_parameters, known=known), high)}
    efforts = {joint.name: joint.type.effort_unit for joint in model.mechanism.joints}
    if curves := friction_curves(known):
        high = HALF * math.ceil(len(curves) / ABREAST)
        pictures["friction"] = (partial(draw_friction, curves=curves, efforts=efforts), high)
    if torque is not None:
        high = 0.75 * HALF * len(torque.samples)
        pictures["torque"] = (partial(draw_torque, step=torque, efforts=efforts), high)
    files["preview.tex"] = preview(tuple(files), tuple(pictures))
    for name, (draw, high) in pictures.items():
        files |= document(name, draw, (FULL, high))
    write_together(Path(folder), files)
    return [Path(folder) / name for name in files]


def require_own_folder(folder: str | Path) -> None:
    """Raise InputError if a folder has files, but none that the command `psdmc figures` wrote."""
    table = Path(folder) / TABLE
    try:
        with table.open("rb") as file:
            is_own = file.read(len(MARK)) == MARK.encode()
    except OSError:
        is_own = False
    if not is_own:
        refuse_foreign_folder(folder, "choose a new or empty folder with -o DIR")


def _torque(model: DynamicsModel, log: str | Path, progress: Progress) -> StepQuality:
    """Measured and predicted torque of the logs that `psdmc validate` would read."""
    logs, _ = opened_logs(delivered(model), log, LogNaming(), progress)
    return next(iter(delivered_quality(model, logs)))


# Figures


def draw_parameters(figure: Figure, known: Calibrated) -> None:
    """Draw the base parameters with confidence intervals, an axis per unit. Open circles: the robot file."""
    units = list(dict.fromkeys(row.unit for row in known.parameters))
    groups = [[row for row in known.parameters if row.unit == unit] for unit in units]
    axes = figure.subplots(len(units), 1, squeeze=False, height_ratios=[len(rows) + 2 for rows in groups])
    for axis, unit, rows in zip(axes[:, 0], units, groups, strict=True):
        spread = [row.std for row in rows if 0.0 < row.std < math.inf]
        sizes = spread or [abs(row.value) for row in rows if row.value] or [1.0]
        first = math.floor(math.log10(np.median(sizes)))
        axis.set_xscale("symlog", linthresh=10.0**first)
        for k, row in enumerate(rows):
            colour = MEASURED if row.identifiable else RESIDUAL
            reach = DEVIATIONS * row.std if math.isfinite(row.std) else None
            axis.errorbar(row.value, k, xerr=reach, fmt="o", color=colour, markersize=3.5, capsize=2)
            if row.file is not None:
                axis.plot(row.file, k, "o", color=PREDICTED, markerfacecolor="none", markersize=6)
        axis.set_yticks(range(len(rows)), [row.name for row in rows], parse_math=False)
        axis.invert_yaxis()
        axis.tick_params(axis="x", labelsize=8)
        low, high = axis.get_xlim()
        axis.set_xticks(_powers(low, high, first))
        axis.set_xlabel(
            f"{unit}; bars: ± {DEVIATIONS:g} standard deviations, circles: robot file, grey: not identified",
            parse_math=False,
        )


def _powers(low: float, high: float, first: int) -> list[float]:
    """Zero and powers of ten of both signs in a range, as ticks. They are few enough to leave their labels apart on an
    axis that is linear below 10^first."""
    last = max(first, math.floor(math.log10(max(abs(low), abs(high)))))
    step = math.ceil((last - first + 1) / TICKS)
    each = [10.0**power for power in range(last, first - 1, -step) if power - first + 1 >= step]
    return sorted(value for value in (*(-x for x in each), 0.0, *each) if low <= value <= high)


def friction_curves(known: Calibrated) -> dict[str, tuple[Array, Array]]:
    """Return for each joint an array of speeds and the friction torques at these constant speeds. The offset is left
    out, and friction that depends on position or load."""
    law = known.prediction
    if law is None:
        return {}
    speeds = {row.joint: row.speed for row in known.verdict.joints} if known.verdict is not None else {}
    found = {}
    for joint in known.joint_names:
        values = {row.name: row.value for row in known.friction if row.joint == joint}
        rows = [
            row
            for row in rows_of(values, law.law, law.laws)
            if row[0].law is not OPTIONAL and row[1] and not {"q", "load"} & _reads(row)
        ]
        rms = speeds.get(joint, math.nan)
        top = TIMES_SPEED * rms if math.isfinite(rms) and rms > 0.0 else 1.0
        half = np.linspace(top / CURVE, top, CURVE)
        v = np.concatenate([-half[::-1], half])
        if rows and all(np.isfinite(row[1]).all() for row in rows):
            found[joint] = (v, steady(rows, v, law.sign_speed))
    return found


def _reads(row: Row) -> frozenset[str]:
    return frozenset() if row[0].law.state is not None else row[0].reads


def steady(rows: Sequence[Row], v: Array, sign_speed: float) -> Array:
    """Return the friction torque or force at constant speeds that are not zero. A friction model with an internal
    state, such as LuGre's, has the value that the state approaches at this speed."""
    sign = np.tanh(v / sign_speed) if sign_speed > 0.0 else np.sign(v)
    state, z = rows[0][0].law.state, np.zeros_like(v)
    if state is not None:
        at_zero = state.rate(rows[0][1], v, z)
        z = -at_zero / (state.rate(rows[0][1], v, z + 1.0) - at_zero)
    return np.asarray(total(rows, At(0.0, v, sign, 0.0, z)) + np.zeros_like(v))


def draw_friction(
    figure: Figure, curves: Mapping[str, tuple[Array, Array]], efforts: Mapping[str, str]
) -> None:
    """Draw the friction of each joint against its speed. `efforts` are the units of torque or force of the joints."""
    axes = list(figure.subplots(math.ceil(len(curves) / ABREAST), ABREAST, squeeze=False).flat)
    for axis in axes[len(curves) :]:
        axis.set_visible(False)
    for axis, (joint, (v, torque)) in zip(axes, curves.items(), strict=False):
        half = len(v) // 2
        for part in (slice(None, half), slice(half, None)):
            axis.plot(v[part], torque[part], color=MEASURED, linewidth=1.2)
        axis.axhline(0.0, color=RESIDUAL, linewidth=0.5)
        axis.set_title(joint, fontsize=9, loc="left", parse_math=False)
        axis.set_xlabel("speed [m/s]" if efforts[joint] == "N" else "speed [rad/s]", fontsize=8)
        axis.set_ylabel(f"friction without offset [{efforts[joint]}]", fontsize=8)
        axis.tick_params(labelsize=8)


def draw_torque(figure: Figure, step: StepQuality, efforts: Mapping[str, str]) -> None:
    """Draw the measured torque, the predicted torque and their difference for each joint."""
    rows = figure.subplots(len(step.samples), 2, squeeze=False, sharex="row", width_ratios=[2, 1])
    for (both, left), sample in zip(rows, step.samples, strict=True):
        kept = thinned(len(sample.x))
        x, measured, predicted = sample.x[kept], sample.measured[kept], sample.predicted[kept]
        both.plot(x, measured, color=MEASURED, linewidth=1.0, label="measured")
        both.plot(x, predicted, color=PREDICTED, linewidth=0.7, linestyle="--", label="predicted")
        left.plot(x, measured - predicted, color=RESIDUAL, linewidth=0.6)
        rms = math.sqrt(float(np.mean((sample.measured - sample.predicted) ** 2)))
        both.set_title(sample.joint, fontsize=9, loc="left", parse_math=False)
        left.set_title(f"residual, RMS {rms:.3g}", fontsize=9, loc="left")
        both.set_ylabel(f"torque [{efforts[sample.joint]}]", fontsize=8)
        for axis in (both, left):
            axis.tick_params(labelsize=8)
    for axis in rows[-1]:
        axis.set_xlabel(step.samples[-1].abscissa, fontsize=8)
    handles, labels = rows[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8, frameon=False)


# Tables


def tables(model: DynamicsModel, known: Calibrated) -> dict[str, str]:
    """Return the tables of a calibration as LaTeX, by file name, for booktabs, longtable and siunitx."""
    equations = [parameter.terms for parameter in model.base_parameters]
    parameters = [
        [
            f"${{\\theta_{{{k}}}}}$",
            f"${terms_latex(terms)}$",
            "--" if row.file is None else number(row.file),
            _seen(row, row.identifiable),
            unit(row.unit),
        ]
        for k, (row, terms) in enumerate(zip(known.parameters, equations, strict=True))
    ]
    joints = [
        [escaped(row.joint), escaped(row.name.replace("_", " ")), _seen(row, row.seen), unit(row.unit)]
        for row in (*known.motors, *known.friction, *known.elasticity, *known.springs)
    ]
    accuracy = [
        [
            escaped(joint),
            escaped(step.step),
            *(number(value) for value in (step.joints[joint].held_out.r2, step.joints[joint].held_out.rmse)),
        ]
        for joint in known.joint_names
        for step in known.steps
        if joint in step.joints
    ]
    head = ["", "Base parameter", "Robot file", "Calibrated", "Unit"]
    found = {TABLE: tabular(r"lp{0.36\linewidth}rrl", head, parameters, "longtable")}
    if joints:
        found["joints.tex"] = tabular("llrl", ["Joint", "Quantity", "Value", "Unit"], joints)
    if accuracy:
        found["accuracy.tex"] = tabular(
            "llrr", ["Joint", "Step", "$R^2$", r"RMSE [\unit{N.m}; \unit{N} of sliding joints]"], accuracy
        )
    return found


def _seen(row: NumberRow | ParameterRow, is_identified: bool) -> str:
    """A calibrated number; in brackets what the data do not identify, which is grey in the pictures."""
    text = number(row.value, row.std)
    return text if is_identified else f"({text})"


def tabular(columns: str, head: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "tabular") -> str:
    """Return a LaTeX table from cells in LaTeX. A longtable repeats its head on each page."""
    packages = "booktabs,siunitx" if kind == "tabular" else f"booktabs,{kind},siunitx"
    lines = [
        f"{MARK}; needs \\usepackage{{{packages}}}",
        f"\\begin{{{kind}}}{{{columns}}}",
        r"\toprule",
        " & ".join(head) + r" \\",
        r"\midrule",
        *([] if kind == "tabular" else [r"\endhead"]),
        *(" & ".join(row) + r" \\" for row in rows),
        r"\bottomrule",
        f"\\end{{{kind}}}",
    ]
    return "\n".join(lines) + "\n"


def preview(names: Sequence[str], pictures: Sequence[str]) -> str:
    """A document that shows all of it."""
    size = r"width=\linewidth,height=0.95\textheight,keepaspectratio"
    lines = [
        MARK,
        r"\documentclass{article}",
        r"\usepackage[margin=20mm]{geometry}",
        r"\usepackage{amsmath,booktabs,graphicx,longtable,siunitx}",
        r"\begin{document}",
        r"\footnotesize",
        *(rf"\begin{{center}}\input{{{name}}}\end{{center}}" for name in names),
        *(rf"\begin{{center}}\includegraphics[{size}]{{{name}.pdf}}\end{{center}}" for name in pictures),
        r"\end{document}",
    ]
    return "\n".join(lines) + "\n"


def number(value: float, std: float = math.inf) -> str:
    """Return a number for siunitx, rounded to two digits of its standard deviation; a dash for none. psdmc rounds the
    number itself, because siunitx drops the standard deviation of a number that is much smaller."""
    if not math.isfinite(value):
        return "--"
    if not 0.0 < std < math.inf:
        return rf"\num{{{value:.4g}}}"
    places = max(0, DIGITS - 1 - math.floor(math.log10(std)))
    return rf"\num{{{round(value, places) + 0.0:.{places}f} +- {std:.{places}f}}}"


UNIT = re.compile(r"[A-Za-z0-9.^/ ]+")


def unit(text: str) -> str:
    """Return a unit in the notation of the LaTeX package siunitx, from psdmc's notation."""
    if not text or text == "-":
        return ""
    if not UNIT.fullmatch(text):
        return escaped(text)
    letters = re.sub(r"\bNms\b", "N.m.s", re.sub(r"\bNm\b", "N.m", re.sub(r"\bNs\b", "N.s", text)))
    raised = re.sub(r"\^([0-9.]+)", r"^{\1}", letters.strip().replace(" ", "."))
    return rf"\unit{{{raised}}}"


SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    **{letter: f"\\{letter}" for letter in "{}$&#_%"},
}


def escaped(text: str) -> str:
    """Return LaTeX code that prints a text. Characters outside ASCII and Latin-1 are printed as their number."""
    return "".join(
        SPECIAL.get(c, c) if " " <= c <= "~" or "\xc0" <= c <= "\xff" else f"U+{ord(c):04X}" for c in text
    )
