"""Pictures of a calibration, like Denso-2022's figures 2 to 5, as SVG text."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

from psdmc.calibration.identify.steps import Sample, StepQuality
from psdmc.calibration.logs.log import Array
from psdmc.calibration.motions.excite import Excitation
from psdmc.report.drawing import Axes, Figure, new_figure, style

POINTS = 600
"""Points drawn per curve; more would only make the file larger."""

MEASURED, PREDICTED, RESIDUAL, HELD_OUT = "#4878a8", "#d95f02", "#888888", "#f3ead9"


def step_figure(step: StepQuality) -> str:
    """Observed and predicted torque of every joint, the residual below zero's line, held-out stretches shaded."""
    rows = (len(step.samples) + 1) // 2
    figure = new_figure(figsize=(11, 2.3 * rows))
    axes = figure.subplots(rows, 2, squeeze=False)
    for axis, sample in zip(axes.flat, step.samples, strict=False):
        _sample(axis, sample)
    for axis in axes.flat[len(step.samples) :]:
        axis.set_visible(False)
    axes.flat[0].legend(loc="upper right", fontsize=7, framealpha=0.8)
    return svg_text(figure)


def _sample(axis: Axes, sample: Sample) -> None:
    order = (
        np.argsort(sample.x, kind="stable")
        if sample.abscissa.startswith("position")
        else np.arange(len(sample.x))
    )
    kept = order[_thin(len(order))]
    x = sample.x[kept]
    _shade(axis, x, sample.held_out[kept])
    axis.plot(x, sample.measured[kept], color=MEASURED, linewidth=1.2, label="observed")
    axis.plot(x, sample.predicted[kept], color=PREDICTED, linewidth=0.8, linestyle="--", label="predicted")
    residual = sample.measured[kept] - sample.predicted[kept]
    axis.plot(x, residual, color=RESIDUAL, linewidth=0.6, label="residual")
    axis.set_title(sample.joint, fontsize=9, loc="left")
    axis.set_xlabel(sample.abscissa, fontsize=8)
    axis.set_ylabel("torque [Nm]", fontsize=8)
    axis.tick_params(labelsize=7)


def _thin(count: int) -> Array:
    """Indices of evenly spread points, all of them where they are few. (A contiguous stretch would hide the rest.)"""
    return np.unique(np.linspace(0, count - 1, min(count, POINTS)).astype(int))


def _shade(axis: Axes, x: Array, held_out: Array) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held_out.astype(int), [0]])))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        axis.axvspan(x[first], x[min(last, len(x) - 1)], color=HELD_OUT, linewidth=0)


def excitation_figure(found: Excitation, joint_names: Sequence[str]) -> str:
    """The exciting motion's positions, speeds and accelerations, and its condition during the search."""
    motion = found.motion.sampled(tuple(joint_names), found.motion.duration / 400)
    figure = new_figure(figsize=(11, 6))
    axes = figure.subplots(2, 2)
    series = (
        ("position [rad]", motion.q),
        ("speed [rad/s]", motion.qd),
        ("acceleration [rad/s²]", motion.qdd),
    )
    for axis, (label, values) in zip(axes.flat, series, strict=False):
        axis.plot(motion.time, values, linewidth=0.9, label=list(joint_names))
        axis.set_xlabel("time [s]", fontsize=8)
        axis.set_ylabel(label, fontsize=8)
    axes.flat[0].legend(fontsize=7, ncols=3)
    last = axes.flat[3]
    last.hist(np.minimum(found.random_conditions, 50 * found.condition), bins=40, color=RESIDUAL)
    last.axvline(found.condition, color=PREDICTED, linewidth=1.5)
    last.set_xlabel("condition number: random motions (grey), the one found (line)", fontsize=8)
    return svg_text(figure)


def svg_text(figure: Figure) -> str:
    """A figure as inline SVG: the same bytes for the same numbers."""
    with style({"svg.hashsalt": "psdmc", "svg.fonttype": "none", "path.simplify": True}):
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
