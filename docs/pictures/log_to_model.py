"""What psdmc calibrate does with a log: log_to_model.svg."""

from __future__ import annotations

from pictures.canvas import Canvas

NAME = "log_to_model.svg"

STEPS = (
    ("Log", "time, positions, torques or currents", "bbox"),
    ("Read and check", "units, signs, gaps, limits", "box"),
    ("Filter", "low-pass, then velocity and acceleration", "box"),
    ("Fit", "theta_b and friction, to 70 % of the log", "abox"),
    ("Verdict", "predicts the other 30 % of the log", "cbox"),
    ("Calibrated model", "and a report with plots", "abox"),
)


def draw() -> str:
    canvas = Canvas(
        448,
        "psdmc calibrate reads and checks a log, filters it, fits theta_b and friction to 70 % of"
        " it, predicts the other 30 % with the result, and writes a calibrated model and a report.",
        "From a log to a calibrated model",
    )
    for step, (title, says, style) in enumerate(STEPS):
        y = 42 + step * 67
        canvas.box(14, y, 280, 46, style)
        canvas.text(26, y + 19, title, "bold")
        canvas.text(26, y + 37, says, "small soft")
        if step < len(STEPS) - 1:
            canvas.arrow([(54, y + 46), (54, y + 67)])
    canvas.box(314, 243, 72, 46, "abox")
    canvas.text(350, 262, "Model", "bold", "middle")
    canvas.text(350, 280, "(.npz)", "small soft", "middle")
    canvas.arrow([(314, 266), (296, 266)])
    return canvas.svg
