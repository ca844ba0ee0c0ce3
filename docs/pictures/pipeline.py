"""How a robot file becomes C, and what each command does: pipeline.svg."""

from __future__ import annotations

from pictures.canvas import Canvas

NAME = "pipeline.svg"

STAGES = (
    ("Robot file", "URDF, xacro, MJCF or DH table", "box", "psdmc derive"),
    ("Model", "E, P and base parameters theta_b", "abox", "psdmc emit-c"),
    ("C package", "one function per file, self-test, CMake", "abox", "psdmc build"),
    ("Library", "called from C, C++ or NumPy", "abox", ""),
)


def draw() -> str:
    canvas = Canvas(
        418,
        "A robot file becomes a model by psdmc derive, a C package by psdmc emit-c and a library by psdmc build."
        " psdmc check compares model and C code with Pinocchio. psdmc calibrate finds theta_b from logs of the robot.",
        "From a robot file to C code",
    )
    y = 42
    for title, says, style, command in STAGES:
        canvas.box(14, y, 268, 50, style)
        canvas.text(26, y + 21, title, "bold")
        canvas.text(26, y + 40, says, "small soft")
        if command:
            canvas.arrow([(66, y + 50), (66, y + 92)])
            canvas.text(78, y + 76, command, "code")
        y += 92
    canvas.box(304, 42, 82, 50, "bbox")
    canvas.text(345, 63, "Logs of", "small", "middle")
    canvas.text(345, 80, "the robot", "small", "middle")
    canvas.arrow([(345, 92), (345, 148), (284, 148)], "lb")
    canvas.text(339, 124, "psdmc calibrate", "code tb", "end")
    canvas.box(304, 226, 82, 50, "cbox")
    canvas.text(345, 247, "Pinocchio,", "small", "middle")
    canvas.text(345, 264, "MuJoCo", "small", "middle")
    canvas.arrow([(345, 226), (345, 168), (284, 168)], "lc dash")
    canvas.text(339, 198, "psdmc check", "code tc", "end")
    canvas.text(14, 388, "A solid arrow makes a new file.", "small soft")
    canvas.text(14, 406, "The dashed arrow compares results, changes no file.", "small soft")
    return canvas.svg
